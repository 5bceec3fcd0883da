//! Host and kernels share one layout: sizes and places of fields are compared with those that naga makes of the WGSL.

use roost_solver::gpu::layout;
use roost_solver::gpu::source::Source;
use wgpu::naga::{TypeInner, front::wgsl};

#[test]
fn struct_layouts_are_equal_in_rust_and_wgsl() {
    let text = Source::kernels().text("");
    let module = wgsl::parse_str(&text).unwrap_or_else(|error| panic!("{}", error.emit_to_string(&text)));
    for (name, size, fields) in layout::all() {
        let of_name = |(_, ty): &(_, &wgpu::naga::Type)| ty.name.as_deref() == Some(name);
        let (_, ty) = module.types.iter().find(of_name).unwrap_or_else(|| panic!("{name} in the kernels"));
        let TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is a struct") };
        assert_eq!(*span as usize, size, "size of {name}");
        let found: Vec<(&str, usize)> = members
            .iter()
            .map(|member| (member.name.as_deref().unwrap_or(""), member.offset as usize))
            .collect();
        assert_eq!(found, fields, "fields of {name}");
    }
}
