// The buffers. Each holds the parts of all runs of the batch one behind the other. Indices of sub-particles,
// facets and surfaces in them are relative to the run.

// Data of runs.
@group(0) @binding(0) var<storage, read> scenes: array<Scene>;
@group(0) @binding(1) var<storage, read> surfaces: array<Surface>;
@group(0) @binding(2) var<storage, read> poses: array<Pose>;
@group(0) @binding(3) var<storage, read> facets: array<Facet>;
@group(0) @binding(4) var<storage, read> corners: array<Corner>;
@group(0) @binding(5) var<storage, read> nodes: array<Node>;
@group(0) @binding(6) var<storage, read> leaves: array<u32>;
@group(0) @binding(7) var<storage, read_write> reports: array<Report>;

// Sub-particles before and after the step, swapped every step.
@group(1) @binding(0) var<storage, read> particles: array<Particle>;
@group(1) @binding(1) var<storage, read_write> moved: array<Particle>;
@group(1) @binding(2) var<storage, read_write> private_state: array<PrivateState>;
// Run of each sub-particle.
@group(1) @binding(3) var<storage, read> scene_of: array<u32>;
// Positions when the lists were built.
@group(1) @binding(4) var<storage, read_write> reference: array<vec4<i32>>;
// The cell list: first sub-particle of each cell, and successor of each, from 1; 0 ends the chain.
@group(1) @binding(5) var<storage, read_write> heads: array<atomic<u32>>;
@group(1) @binding(6) var<storage, read_write> chain: array<u32>;

// The current lists and the lists under construction, swapped at every rebuild: a row per sub-particle.
@group(2) @binding(0) var<storage, read_write> counts: array<Count>;
@group(2) @binding(1) var<storage, read_write> pairs: array<Pair>;
@group(2) @binding(2) var<storage, read_write> walls: array<WallPair>;
@group(2) @binding(3) var<storage, read_write> new_counts: array<Count>;
@group(2) @binding(4) var<storage, read_write> new_pairs: array<Pair>;
@group(2) @binding(5) var<storage, read_write> new_walls: array<WallPair>;
// Nearest points of the facets in each row, within a step.
@group(2) @binding(6) var<storage, read_write> nearest_points: array<NearestPoint>;
// Moments of bonds, for the runs whose bonds carry any: a row beside each row of pairs.
@group(2) @binding(7) var<storage, read_write> moments: array<Moment>;
@group(2) @binding(8) var<storage, read_write> new_moments: array<Moment>;

var<immediate> dispatch: DispatchParams;

// Index of an invocation. Workgroups form rows, since a device allows at most 65,535 along one dimension.
fn invocation_index(group: vec3<u32>, groups: vec3<u32>, local: u32) -> u32 {
    return (group.y * groups.x + group.x) * GROUP_SIZE + local;
}

// Whether the bonds of a run carry moments.
fn has_moments(scene: Scene) -> bool {
    return scene.moment.k_b != 0.0;
}

// Index of the first entry of a row. The next entries follow at distances of `scene.count`: a run has the first entries of
// all its rows side by side, then the second ones. Invocations side by side then use memory side by side.
fn row(scene: Scene, capacity: u32, i: u32) -> u32 {
    return scene.first * capacity + i - scene.first;
}

// The same for the moments of a sub-particle of such a run.
fn moment_row(scene: Scene, i: u32) -> u32 {
    return scene.first_moments * dispatch.pair_capacity + i - scene.first;
}

// Whether a run has finished, or diverged in an earlier step. It then stays unchanged.
fn has_ended(scene: Scene, run: u32) -> bool {
    return dispatch.step >= scene.steps || atomicLoad(&reports[run].fault_step) < dispatch.step;
}
