// The buffers, each with the parts of all runs of the batch one behind the other. Numbers of sub-particles, facets and
// surfaces that stand in them count within their run.

// What runs have of their own.
@group(0) @binding(0) var<storage, read> scenes: array<Scene>;
@group(0) @binding(1) var<storage, read> surfaces: array<Surface>;
@group(0) @binding(2) var<storage, read> poses: array<Pose>;
@group(0) @binding(3) var<storage, read> facets: array<Facet>;
@group(0) @binding(4) var<storage, read> corners: array<Corner>;
@group(0) @binding(5) var<storage, read> nodes: array<Node>;
@group(0) @binding(6) var<storage, read> leaves: array<u32>;
@group(0) @binding(7) var<storage, read_write> reports: array<Report>;

// Sub-particles before and after the step, by turns.
@group(1) @binding(0) var<storage, read> particles: array<Particle>;
@group(1) @binding(1) var<storage, read_write> moved: array<Particle>;
@group(1) @binding(2) var<storage, read_write> private_state: array<PrivateState>;
// Which run each belongs to.
@group(1) @binding(3) var<storage, read> scene_of: array<u32>;
// Where each was when lists were built.
@group(1) @binding(4) var<storage, read_write> reference: array<vec4<i32>>;
// The grid: the first sub-particle of each cell, and the one after each, from 1; 0 ends the chain.
@group(1) @binding(5) var<storage, read_write> heads: array<atomic<u32>>;
@group(1) @binding(6) var<storage, read_write> chain: array<u32>;

// The lists as they are and as they are built anew, by turns: a row of row_capacity for each sub-particle.
@group(2) @binding(0) var<storage, read_write> counts: array<Count>;
@group(2) @binding(1) var<storage, read_write> pairs: array<Pair>;
@group(2) @binding(2) var<storage, read_write> walls: array<WallPair>;
@group(2) @binding(3) var<storage, read_write> new_counts: array<Count>;
@group(2) @binding(4) var<storage, read_write> new_pairs: array<Pair>;
@group(2) @binding(5) var<storage, read_write> new_walls: array<WallPair>;
// How each sub-particle nearest_points the facets of its row, within a step.
@group(2) @binding(6) var<storage, read_write> nearest_points: array<NearestPoint>;

var<immediate> dispatch: DispatchParams;

// The number of an invocation; groups stand in rows, of which a device allows no more than 65,535 in one.
fn invocation_index(group: vec3<u32>, groups: vec3<u32>, local: u32) -> u32 {
    return (group.y * groups.x + group.x) * GROUP_SIZE + local;
}

// Whether a run has ended, or diverged in a step before this one: it stands still.
fn has_ended(scene: Scene, run: u32) -> bool {
    return dispatch.step >= scene.steps || atomicLoad(&reports[run].fault_step) < dispatch.step;
}
