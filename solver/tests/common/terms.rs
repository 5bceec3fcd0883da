//! Single terms of the physics on the GPU: a kernel that calls one function of the WGSL on many random inputs.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses some of these")]

use std::ops::Range;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use roost_solver::gpu::Device;
use roost_solver::gpu::source::Source;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// Inputs that a term is tried on.
const CASES: u32 = 20_000;

/// A function from some numbers to others.
pub type Numbers = fn(&[f32]) -> Vec<f32>;

/// A term: the same function in both languages, on rows of numbers.
pub struct Term {
    pub name: &'static str,
    /// The range of each input.
    pub inputs: Vec<Range<f32>>,
    pub outputs: usize,
    /// Statements that read `x(k)` and call `put(k, value)`.
    pub wgsl: &'static str,
    pub rust: Numbers,
}

/// A number of a range; every sixteenth is a bound of it.
fn draw(random: &mut ChaCha8Rng, range: &Range<f32>) -> f32 {
    let share = random.next_u32() as f32 / u32::MAX as f32;
    match random.next_u32() % 32 {
        0 => range.start,
        1 => range.end,
        _ => range.start + (range.end - range.start) * share,
    }
}

impl Term {
    /// Tries it on random inputs and returns the first on which the two differ in a bit, in words.
    pub fn difference(&self, device: &Device, source: &Source) -> Option<String> {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let width = self.inputs.len();
        let input: Vec<f32> =
            (0..CASES as usize * width).map(|k| draw(&mut random, &self.inputs[k % width])).collect();
        let found = self.on_device(device, source, &input);
        for (case, found) in input.chunks(width).zip(found.chunks(self.outputs)) {
            let wanted = (self.rust)(case);
            let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            if bits(&wanted) != bits(found) {
                return Some(format!("{}: {found:?} is not {wanted:?} for {case:?}", self.name));
            }
        }
        None
    }

    fn on_device(&self, device: &Device, source: &Source, input: &[f32]) -> Vec<f32> {
        let text = source.text(&format!(
            "@group(0) @binding(0) var<storage, read> given: array<f32>;
             @group(0) @binding(1) var<storage, read_write> made: array<f32>;
             var<private> row: u32;
             fn x(k: u32) -> f32 {{ return given[row * {}u + k]; }}
             fn x3(k: u32) -> vec3<f32> {{ return vec3(x(k), x(k + 1u), x(k + 2u)); }}
             fn put(k: u32, value: f32) {{ made[row * {}u + k] = value; }}
             fn put3(k: u32, value: vec3<f32>) {{ put(k, value.x); put(k + 1u, value.y); put(k + 2u, value.z); }}
             @compute @workgroup_size(GROUP_SIZE)
             fn term(@builtin(global_invocation_id) id: vec3<u32>) {{
                 if id.x >= {CASES}u {{ return; }}
                 row = id.x;
                 {}
             }}",
            self.inputs.len(),
            self.outputs,
            self.wgsl
        ));
        let (device, queue, opened) = (device.wgpu().0, device.wgpu().1, device);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(self.name),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(self.name),
            layout: None,
            module: &module,
            entry_point: Some("term"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let buffer = |contents: &[u8]| {
            device.create_buffer_init(&BufferInitDescriptor {
                label: None,
                contents,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            })
        };
        let given = buffer(bytemuck::cast_slice(input));
        let made = buffer(&vec![0; 4 * CASES as usize * self.outputs]);
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: given.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: made.as_entire_binding() },
            ],
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(CASES.div_ceil(64), 1, 1);
        drop(pass);
        queue.submit([encoder.finish()]);
        bytemuck::pod_collect_to_vec(&opened.read(&made, 0, made.size()))
    }
}
