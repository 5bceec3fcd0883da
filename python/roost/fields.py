"""Scenarios as types: the fields of each experiment with meaning, unit, default, range and source.

Generated: write it with `python3 python/generate.py`, and change the Rust types or the field table instead.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Literal, TypeAlias, TypedDict, Union

if sys.version_info >= (3, 11):
    from typing import Required
else:
    from typing_extensions import Required


class MeshFile(TypedDict):
    """An STL file that goes with a submission."""

    file: str
    """Its path, relative to the folder of the document."""
    units: Literal["mm", "m"]
    """The unit of its coordinates, which STL does not state."""


class MeshDigest(TypedDict):
    """An STL file that the server has."""

    digest: str
    """BLAKE3 hash of the file, in hexadecimal."""
    units: Literal["mm", "m"]
    """The unit of its coordinates, which STL does not state."""


class HopperEquipmentSurfacesItem(TypedDict, total=False):
    """Further surfaces, as in `/scene/surfaces`."""

    kind: Literal["equipment", "belt", "frictionless"]
    """Contact parameters. `equipment`: `/contact/fillet_equipment`. `belt`: `/contact/fillet_belt`. `frictionless`:
    `equipment` with zero friction. Source: Table 2. Default: "equipment"."""
    mesh: MeshFile | MeshDigest | None
    """Triangles from an STL file; give exactly one of `mesh` and `plate_m`. A closed part whose normals point outwards
    is solid. A closed box around the fillets needs normals that point inwards. Source: assumed. Default: null."""
    motion: Literal["fixed", "belt", "moving"]
    """Motion from t = 0 on. `fixed`: none. `belt`: the surface stays and its material runs. `moving`: the surface moves
    and turns. Source: assumed. Default: "fixed"."""
    name: Required[str]
    """Name of the surface, in messages and series; each surface has its own. Source: assumed."""
    orientation_deg: Sequence[float]
    """Rotation about `position_m`: yaw, pitch and roll. Unit: °. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    pivot_m: Sequence[float]
    """`moving`: point about which the surface turns, at t = 0. Unit: m. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    plate_m: Sequence[Sequence[float]] | None
    """A flat parallelogram: a corner, and the two edges that leave it. Unit: m. Source: assumed. Default: null."""
    position_m: Sequence[float]
    """Position of the origin of its triangles. Unit: m. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    presence: Literal["always", "until_start"]
    """`always`, or `until_start`: the surface disappears at t = 0, as a shutter. Source: assumed. Default: "always"."""
    spin_deg_s: Sequence[float]
    """`moving`: angular velocity about the pivot. Unit: °/s. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    static_friction: float | None
    """Coulomb coefficient of friction of this surface; null: that of its `kind`. Source: assumed. Default: null. Range:
    ≥ 0 and ≤ 5."""
    velocity_m_s: Sequence[float]
    """`belt`: velocity of the material. `moving`: velocity of the pivot. Unit: m/s. Source: assumed. Default: [0.0,
    0.0, 0.0]."""


class SceneBodiesItem(TypedDict, total=False):
    """Fillets: shape, place, orientation and velocity."""

    orientation_deg: Sequence[float]
    """Rotation: yaw about z, then pitch about its width, then roll about its length. Unit: °. Source: assumed. Default:
    [0.0, 0.0, 0.0]."""
    position_m: Required[Sequence[float]]
    """Position of its centre of mass at the start. Unit: m. Source: assumed."""
    shape: int
    """The body's shape: 2 · (number of the size in `/product/sizes_m`, from 0), plus 1 for its mirror image. Source:
    Fig. 1. Default: 0. Range: ≥ 0 and ≤ 63."""
    velocity_m_s: Sequence[float]
    """Velocity at the start. Unit: m/s. Source: assumed. Default: [0.0, 0.0, 0.0]."""


class SceneSurfacesItem(TypedDict, total=False):
    """Surfaces of triangles that move together."""

    kind: Literal["equipment", "belt", "frictionless"]
    """Contact parameters. `equipment`: `/contact/fillet_equipment`. `belt`: `/contact/fillet_belt`. `frictionless`:
    `equipment` with zero friction. Source: Table 2. Default: "equipment"."""
    mesh: MeshFile | MeshDigest | None
    """Triangles from an STL file; give exactly one of `mesh` and `plate_m`. A closed part whose normals point outwards
    is solid. A closed box around the fillets needs normals that point inwards. Source: assumed. Default: null."""
    motion: Literal["fixed", "belt", "moving"]
    """Motion from t = 0 on. `fixed`: none. `belt`: the surface stays and its material runs. `moving`: the surface moves
    and turns. Source: assumed. Default: "fixed"."""
    name: Required[str]
    """Name of the surface, in messages and series; each surface has its own. Source: assumed."""
    orientation_deg: Sequence[float]
    """Rotation about `position_m`: yaw, pitch and roll. Unit: °. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    pivot_m: Sequence[float]
    """`moving`: point about which the surface turns, at t = 0. Unit: m. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    plate_m: Sequence[Sequence[float]] | None
    """A flat parallelogram: a corner, and the two edges that leave it. Unit: m. Source: assumed. Default: null."""
    position_m: Sequence[float]
    """Position of the origin of its triangles. Unit: m. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    presence: Literal["always", "until_start"]
    """`always`, or `until_start`: the surface disappears at t = 0, as a shutter. Source: assumed. Default: "always"."""
    spin_deg_s: Sequence[float]
    """`moving`: angular velocity about the pivot. Unit: °/s. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    static_friction: float | None
    """Coulomb coefficient of friction of this surface; null: that of its `kind`. Source: assumed. Default: null. Range:
    ≥ 0 and ≤ 5."""
    velocity_m_s: Sequence[float]
    """`belt`: velocity of the material. `moving`: velocity of the pivot. Unit: m/s. Source: assumed. Default: [0.0,
    0.0, 0.0]."""


class ContactFilletBelt(TypedDict, total=False):
    """Between sub-particles and the belt."""

    restitution: float
    """Coefficient of restitution on the belt. Default: that of /contact/fillet_fillet/restitution. Source: assumed.
    Range: > 0 and ≤ 1."""
    static_friction: float
    """Coulomb coefficient of friction on the belt; the paper did not measure it. Dry: as on steel plate. Wet: assumed
    so low that the belt slips, as section 3.4 reports. Default when wet: 0.2. Source: assumed. Default: 0.5. Range: ≥ 0
    and ≤ 5."""
    surface_energy_j_m2: float
    """Surface energy γ on the belt. Unit: J/m². Default: that of /contact/fillet_fillet/surface_energy_j_m2. Source:
    assumed. Range: ≥ 0 and ≤ 10."""


class ContactFilletEquipment(TypedDict, total=False):
    """Between sub-particles and walls, gate, plates."""

    restitution: float
    """Coefficient of restitution on walls, gate and back plate. Default: that of /contact/fillet_fillet/restitution.
    Source: Table 2. Range: > 0 and ≤ 1."""
    static_friction: float
    """Coulomb coefficient of friction on walls, gate and back plate; equal when wet (Fig. 8b). Source: Table 2.
    Default: 0.5. Range: ≥ 0 and ≤ 5."""
    surface_energy_j_m2: float
    """Surface energy γ on walls, gate and back plate. Unit: J/m². Default: that of
    /contact/fillet_fillet/surface_energy_j_m2. Source: Table 2. Range: ≥ 0 and ≤ 10."""


class ContactFilletFillet(TypedDict, total=False):
    """Between sub-particles."""

    restitution: float
    """Coefficient of restitution between fillets. Source: Table 2. Default: 0.0001. Range: > 0 and ≤ 1."""
    static_friction: float
    """Coulomb coefficient of friction between fillets. Source: Table 2. Default: 0.1. Range: ≥ 0 and ≤ 5."""
    surface_energy_j_m2: float
    """Surface energy γ between fillets. Wet: assumed to be the surface tension of water at 20 °C. Unit: J/m². Default
    when wet: 0.0728. Source: Table 2. Default: 0.055. Range: ≥ 0 and ≤ 10."""


class HopperNumericsStop(TypedDict, total=False):
    """Conditions that end a simulation before its duration."""

    when_empty: bool
    """Whether the simulation ends when every fillet has left. Source: numerics. Default: true."""
    when_jammed_s: float | None
    """The simulation ends when nothing has passed the gate for this long, whatever is left inside; null: never. Unit:
    s. Source: numerics. Default: null. Range: > 0 and ≤ 600."""


class DropNumericsStop(TypedDict, total=False):
    """Conditions that end a simulation before its duration."""

    when_done: bool
    """Whether the simulation ends when its responses are known: fillets at rest, or sliding, or the block compressed.
    Source: numerics. Default: true."""


class BendNumericsStop(TypedDict, total=False):
    """Conditions that end a simulation before its duration."""

    when_done: bool
    """Whether the simulation ends when its responses are known: fillets at rest, or sliding, or the block compressed.
    Source: numerics. Default: true."""


class SlideNumericsStop(TypedDict, total=False):
    """Conditions that end a simulation before its duration."""

    when_done: bool
    """Whether the simulation ends when its responses are known: fillets at rest, or sliding, or the block compressed.
    Source: numerics. Default: true."""


class CompressNumericsStop(TypedDict, total=False):
    """Conditions that end a simulation before its duration."""

    when_done: bool
    """Whether the simulation ends when its responses are known: fillets at rest, or sliding, or the block compressed.
    Source: numerics. Default: true."""


class SceneNumericsStop(TypedDict, total=False):
    """Conditions that end a simulation before its duration."""

    when_done: bool
    """Whether the simulation ends when its responses are known: fillets at rest, or sliding, or the block compressed.
    Source: numerics. Default: false."""
    when_empty: bool
    """Whether the simulation ends when every fillet has left. Source: numerics. Default: true."""


class Bonds(TypedDict, total=False):
    """The bonds between the sub-particles of a fillet."""

    contact_between_bonded: bool
    """Whether bonded neighbours also have a contact force, as in the commercial model. Source: assumed. Default: true.
    """
    contact_radius_ratio: float
    """Contact radius over sub-particle radius. A bond breaks when it is longer than twice the contact radius. Keep it
    below √3. Source: Table 2. Default: 1.732. Range: > 1 and ≤ 1.732."""
    disk_scale: float
    """Radius of the bond disk over that of a sub-particle, R_b / R. Source: assumed. Default: 1.0. Range: > 0 and ≤ 2.
    """
    formulation: Literal["corotated", "as_published", "finite_extension"]
    """Rule for the bond force. `corotated`: turns with the bond. `as_published`: keeps its direction.
    `finite_extension`: as `corotated`, and stiffens near breakage. Source: eq. 6. Default: "corotated"."""
    moment_stiffness_factor: float
    """Bending and twisting stiffness of a bond, as a multiple of the parallel bond of Potyondy and Cundall 2004. 0:
    bonds carry no moments, as in the paper. 1: S_n I and S_t J. Source: assumed. Default: 0.0. Range: ≥ 0 and ≤ 10."""
    normal_stiffness_n_m3: float
    """Normal stiffness per unit area, S_n. Unit: N/m³. Source: Table 2. Default: 1000000.0. Range: > 0 and ≤
    1000000000000."""
    normal_strength_pa: float | None
    """Normal strength of a bond; null: stress does not break it. Unit: Pa. Source: Table 2 has 1e300. Default: null.
    Range: > 0 and ≤ 1e+300."""
    reference_radius_m: float | None
    """Sub-particle radius R_ref at which S_n and S_t hold. At another radius R they are multiplied by R_ref / R, so
    that the modulus of the lattice stays. Null: no factor. Unit: m. Source: section 2.2. Default: 0.004. Range: ≥
    0.0005 and ≤ 0.05."""
    shear_stiffness_n_m3: float
    """Shear stiffness per unit area, S_t. Unit: N/m³. Source: Table 2. Default: 600000.0. Range: ≥ 0 and ≤
    1000000000000."""
    shear_strength_pa: float | None
    """Shear strength of a bond; null: stress does not break it. Unit: Pa. Source: Table 2 has 1e300. Default: null.
    Range: > 0 and ≤ 1e+300."""
    types: int
    """Sub-particle types (Fig. 2). 2: bonds only along the lattice edges. 1: also across diagonals within the contact
    radius. Source: section 2.2. Default: 2. Range: ≥ 1 and ≤ 2."""


class HopperContact(TypedDict, total=False):
    """The contacts between fillets and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` only changes defaults; a value that you write has priority. Source: section 2.4.
    Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """Between sub-particles and the belt."""
    fillet_equipment: ContactFilletEquipment
    """Between sub-particles and walls, gate, plates."""
    fillet_fillet: ContactFilletFillet
    """Between sub-particles."""
    fillet_fillet_radius_ratio: float
    """Radius of a sub-particle towards other fillets, over `/product/subparticle_radius_m`. At 1 the lattice has holes
    that sub-particles of other fillets slip into; 1.225 closes them. Source: assumed. Default: 1.0. Range: ≥ 1 and ≤
    1.5."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies are given. The energy at radius R is then γ R/R₀,
    and a surface pulls with 3πγ/(4 R₀) per area at any R, as a liquid film does. Null: γ at any radius. Unit: m.
    Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class DropContact(TypedDict, total=False):
    """The contacts between fillets and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` only changes defaults; a value that you write has priority. Source: section 2.4.
    Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """Between sub-particles and the belt."""
    fillet_equipment: ContactFilletEquipment
    """Between sub-particles and walls, gate, plates."""
    fillet_fillet: ContactFilletFillet
    """Between sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies are given. The energy at radius R is then γ R/R₀,
    and a surface pulls with 3πγ/(4 R₀) per area at any R, as a liquid film does. Null: γ at any radius. Unit: m.
    Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class BendContact(TypedDict, total=False):
    """The contacts between fillets and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` only changes defaults; a value that you write has priority. Source: section 2.4.
    Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """Between sub-particles and the belt."""
    fillet_equipment: ContactFilletEquipment
    """Between sub-particles and walls, gate, plates."""
    fillet_fillet: ContactFilletFillet
    """Between sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies are given. The energy at radius R is then γ R/R₀,
    and a surface pulls with 3πγ/(4 R₀) per area at any R, as a liquid film does. Null: γ at any radius. Unit: m.
    Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class SlideContact(TypedDict, total=False):
    """The contacts between fillets and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` only changes defaults; a value that you write has priority. Source: section 2.4.
    Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """Between sub-particles and the belt."""
    fillet_equipment: ContactFilletEquipment
    """Between sub-particles and walls, gate, plates."""
    fillet_fillet: ContactFilletFillet
    """Between sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies are given. The energy at radius R is then γ R/R₀,
    and a surface pulls with 3πγ/(4 R₀) per area at any R, as a liquid film does. Null: γ at any radius. Unit: m.
    Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class CompressContact(TypedDict, total=False):
    """The contacts between fillets and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` only changes defaults; a value that you write has priority. Source: section 2.4.
    Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """Between sub-particles and the belt."""
    fillet_equipment: ContactFilletEquipment
    """Between sub-particles and walls, gate, plates."""
    fillet_fillet: ContactFilletFillet
    """Between sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies are given. The energy at radius R is then γ R/R₀,
    and a surface pulls with 3πγ/(4 R₀) per area at any R, as a liquid film does. Null: γ at any radius. Unit: m.
    Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class SceneContact(TypedDict, total=False):
    """The contacts between fillets and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` only changes defaults; a value that you write has priority. Source: section 2.4.
    Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """Between sub-particles and the belt."""
    fillet_equipment: ContactFilletEquipment
    """Between sub-particles and walls, gate, plates."""
    fillet_fillet: ContactFilletFillet
    """Between sub-particles."""
    fillet_fillet_radius_ratio: float
    """Radius of a sub-particle towards other fillets, over `/product/subparticle_radius_m`. At 1 the lattice has holes
    that sub-particles of other fillets slip into; 1.225 closes them. Source: assumed. Default: 1.0. Range: ≥ 1 and ≤
    1.5."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies are given. The energy at radius R is then γ R/R₀,
    and a surface pulls with 3πγ/(4 R₀) per area at any R, as a liquid film does. Null: γ at any radius. Unit: m.
    Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class HopperEquipment(TypedDict, total=False):
    """Hopper, gate and belt. The dimensions of Fig. 5 are derived."""

    belt_speed_m_s: float
    """Speed of the belt from t = 0 on; the paper has 15 m/min. With `parametric` false the belt among `surfaces` has
    its own. Unit: m/s. Source: section 2.4. Default: 0.25. Range: ≥ 0 and ≤ 10."""
    feed_kg_s: float
    """Mass of fillets that enters from above per second, from t = 0 on. They fall from `hopper_height_m`, at random
    places where they touch nothing. 0: no feed. Unit: kg/s. Source: assumed. Default: 0.0. Range: ≥ 0 and ≤ 1000."""
    gate_opening_m: float
    """Height of the gate's lower edge above the belt. With `parametric` false it does nothing: see `opening_height_m`.
    Unit: m. Source: Fig. 5. Default: 0.06. Range: ≥ 0.001 and ≤ 5."""
    hopper_height_m: float
    """Height of the hopper walls above the belt. Unit: m. Source: assumed. Default: 0.5. Range: ≥ 0.01 and ≤ 10."""
    hopper_length_m: float
    """Inner length of the hopper along the belt (x), at the belt. Unit: m. Source: derived. Default: 0.3. Range: ≥ 0.01
    and ≤ 10."""
    hopper_width_m: float
    """Inner width of the hopper across the belt (y); derived from 33.2 kg in 4 s. Unit: m. Source: derived. Default:
    0.59. Range: ≥ 0.01 and ≤ 10."""
    opening_height_m: float | None
    """With `parametric` false: height of the gate's lower edge above the belt. Null: no belt capacity, and `regime` is
    null. Unit: m. Source: assumed. Default: null. Range: ≥ 0.001 and ≤ 5."""
    opening_width_m: float | None
    """With `parametric` false: inner width of the opening under the gate. Null: no belt capacity, and `regime` is null.
    Unit: m. Source: assumed. Default: null. Range: ≥ 0.001 and ≤ 10."""
    parametric: bool
    """Whether Roost makes belt, walls, gate and shutter from these fields. False: only `surfaces` exist. Source:
    assumed. Default: true."""
    shutter_while_filling: bool
    """Whether a shutter closes the opening until the belt starts. Source: assumed. Default: true."""
    side_walls: Literal["rough", "frictionless", "periodic"]
    """The walls along the belt. `rough`: with the equipment's friction. `frictionless`: a slice of a wide hopper.
    `periodic`: no walls; a fillet that leaves on one side enters on the other. Source: section 2.4. Default: "rough".
    """
    surface_loads: bool
    """Whether the result has the series of force and torque on each surface. They make it ten times as large. Source:
    numerics. Default: false."""
    surfaces: Sequence[HopperEquipmentSurfacesItem]
    """Further surfaces, as in `/scene/surfaces`."""
    wall_slope_deg: float
    """Slope of the back wall from the vertical; the hopper widens upwards. Unit: °. Source: assumed. Default: 0.0.
    Range: ≥ 0 and ≤ 80."""


class Material(TypedDict, total=False):
    """Elastic constants of the tissue."""

    poisson_ratio: float
    """Poisson's ratio of the tissue. Source: Table 2. Default: 0.37. Range: > -1 and < 0.5."""
    youngs_modulus_pa: float
    """Young's modulus of the tissue. Unit: Pa. Source: Table 2. Default: 48600.0. Range: ≥ 100 and ≤ 10000000000."""


class HopperNumerics(TypedDict, total=False):
    """Time step, duration, sampling and stopping."""

    allow_unstable: bool
    """Whether time steps above the stability limit are accepted, for stability studies. Source: numerics. Default:
    false."""
    duration_s: float
    """Simulated time from t = 0: the start of the belt, or of the test. Unit: s. Source: numerics. Default: 6.0. Range:
    > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards; 0 by default in `compress`, where the block's weight would distort the curve.
    Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    jam_after_s: float
    """A hopper has jammed when nothing passes the gate for this long while at least 5 % of the filled mass is inside. A
    shorter `when_jammed_s` counts instead. Unit: s. Source: numerics. Default: 1.0. Range: > 0 and ≤ 600."""
    max_fill_s: float
    """If the bed is not at rest after this time, the simulation ends. Unit: s. Source: numerics. Default: 10.0. Range:
    > 0 and ≤ 600."""
    output_interval_s: float
    """Interval between samples. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The bed is at rest, and the belt starts, when 99.9 % of the sub-particles are slower than this. Unit: m/s.
    Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """A sub-particle that is faster ends the simulation as `unstable`. Unit: m/s. Source: numerics. Default: 30.0.
    Range: ≥ 1 and ≤ 10000."""
    stop: HopperNumericsStop
    """Conditions that end a simulation before its duration."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: the stability limit with a margin, from stiffness, mass, damping and the speed at the start.
    Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class DropNumerics(TypedDict, total=False):
    """Time step, duration, sampling and stopping."""

    allow_unstable: bool
    """Whether time steps above the stability limit are accepted, for stability studies. Source: numerics. Default:
    false."""
    duration_s: float
    """Simulated time from t = 0: the start of the belt, or of the test. Unit: s. Source: numerics. Default: 2.0. Range:
    > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards; 0 by default in `compress`, where the block's weight would distort the curve.
    Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    output_interval_s: float
    """Interval between samples. Unit: s. Source: numerics. Default: 0.002. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The bed is at rest, and the belt starts, when 99.9 % of the sub-particles are slower than this. Unit: m/s.
    Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """A sub-particle that is faster ends the simulation as `unstable`. Unit: m/s. Source: numerics. Default: 30.0.
    Range: ≥ 1 and ≤ 10000."""
    stop: DropNumericsStop
    """Conditions that end a simulation before its duration."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: the stability limit with a margin, from stiffness, mass, damping and the speed at the start.
    Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class BendNumerics(TypedDict, total=False):
    """Time step, duration, sampling and stopping."""

    allow_unstable: bool
    """Whether time steps above the stability limit are accepted, for stability studies. Source: numerics. Default:
    false."""
    duration_s: float
    """Simulated time from t = 0: the start of the belt, or of the test. Unit: s. Source: numerics. Default: 5.0. Range:
    > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards; 0 by default in `compress`, where the block's weight would distort the curve.
    Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    max_fill_s: float
    """If the bed is not at rest after this time, the simulation ends. Unit: s. Source: numerics. Default: 10.0. Range:
    > 0 and ≤ 600."""
    output_interval_s: float
    """Interval between samples. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The bed is at rest, and the belt starts, when 99.9 % of the sub-particles are slower than this. Unit: m/s.
    Source: numerics. Default: 0.02. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """A sub-particle that is faster ends the simulation as `unstable`. Unit: m/s. Source: numerics. Default: 30.0.
    Range: ≥ 1 and ≤ 10000."""
    stop: BendNumericsStop
    """Conditions that end a simulation before its duration."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: the stability limit with a margin, from stiffness, mass, damping and the speed at the start.
    Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class SlideNumerics(TypedDict, total=False):
    """Time step, duration, sampling and stopping."""

    allow_unstable: bool
    """Whether time steps above the stability limit are accepted, for stability studies. Source: numerics. Default:
    false."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards; 0 by default in `compress`, where the block's weight would distort the curve.
    Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    max_fill_s: float
    """If the bed is not at rest after this time, the simulation ends. Unit: s. Source: numerics. Default: 10.0. Range:
    > 0 and ≤ 600."""
    output_interval_s: float
    """Interval between samples. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The bed is at rest, and the belt starts, when 99.9 % of the sub-particles are slower than this. Unit: m/s.
    Source: numerics. Default: 0.01. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """A sub-particle that is faster ends the simulation as `unstable`. Unit: m/s. Source: numerics. Default: 30.0.
    Range: ≥ 1 and ≤ 10000."""
    stop: SlideNumericsStop
    """Conditions that end a simulation before its duration."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: the stability limit with a margin, from stiffness, mass, damping and the speed at the start.
    Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class CompressNumerics(TypedDict, total=False):
    """Time step, duration, sampling and stopping."""

    allow_unstable: bool
    """Whether time steps above the stability limit are accepted, for stability studies. Source: numerics. Default:
    false."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards; 0 by default in `compress`, where the block's weight would distort the curve.
    Unit: m/s². Source: assumed. Default: 0.0. Range: ≥ 0 and ≤ 100."""
    output_interval_s: float
    """Interval between samples. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The bed is at rest, and the belt starts, when 99.9 % of the sub-particles are slower than this. Unit: m/s.
    Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """A sub-particle that is faster ends the simulation as `unstable`. Unit: m/s. Source: numerics. Default: 30.0.
    Range: ≥ 1 and ≤ 10000."""
    stop: CompressNumericsStop
    """Conditions that end a simulation before its duration."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: the stability limit with a margin, from stiffness, mass, damping and the speed at the start.
    Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class SceneNumerics(TypedDict, total=False):
    """Time step, duration, sampling and stopping."""

    allow_unstable: bool
    """Whether time steps above the stability limit are accepted, for stability studies. Source: numerics. Default:
    false."""
    duration_s: float
    """Simulated time from t = 0: the start of the belt, or of the test. Unit: s. Source: numerics. Default: 2.0. Range:
    > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards; 0 by default in `compress`, where the block's weight would distort the curve.
    Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    output_interval_s: float
    """Interval between samples. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The bed is at rest, and the belt starts, when 99.9 % of the sub-particles are slower than this. Unit: m/s.
    Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """A sub-particle that is faster ends the simulation as `unstable`. Unit: m/s. Source: numerics. Default: 30.0.
    Range: ≥ 1 and ≤ 10000."""
    stop: SceneNumericsStop
    """Conditions that end a simulation before its duration."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: the stability limit with a margin, from stiffness, mass, damping and the speed at the start.
    Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class HopperProduct(TypedDict, total=False):
    """The fillets: number, size, shape and sub-particles."""

    count: int
    """Number of fillets. Without `shape`, fillets have each size and its mirror image in turn: fillet i has shape i mod
    (2 · sizes). The paper drops 15 of each of six shapes (section 2.3.3). Source: section 2.4. Default: 191. Range: ≥ 1
    and ≤ 100000."""
    density_kg_m3: float | None
    """Density of a fillet: its mass over its volume; null when `subparticle_density_kg_m3` is given. Unit: kg/m³.
    Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["centres", "whole_spheres"]
    """Lattice points that become sub-particles. `centres`: the centre is inside the shape. `whole_spheres`: the whole
    sphere is. Source: assumed. Default: "centres"."""
    mesh: MeshFile | MeshDigest | None
    """A closed mesh as the shape of all fillets. It replaces the teardrop shapes of `sizes_m`. Source: section 2.2.
    Default: null."""
    scale: float
    """Scale factor of fillets and sub-particles. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    shape: int | None
    """Shape of all fillets: 2 · (number of the size, from 0), plus 1 for its mirror image. Null: each shape in turn.
    Source: Fig. 1. Default: null. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float]]
    """Length, width and thickness of each size. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04], [0.172,
    0.072, 0.032], [0.176, 0.072, 0.04]]."""
    spheres: bool
    """Whether each body is one sphere of radius `subparticle_radius_m` with the density `density_kg_m3`, without bonds.
    It replaces the teardrop shapes of `sizes_m`, for grains and for comparisons with other codes. Source: assumed.
    Default: false."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle, instead of `density_kg_m3`. The paper states both, but they contradict each other.
    Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The lattice spacing is 2R; half the radius makes eight times as many sub-particles.
    Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class DropProduct(TypedDict, total=False):
    """The fillets: number, size, shape and sub-particles."""

    count: int
    """Number of fillets. Without `shape`, fillets have each size and its mirror image in turn: fillet i has shape i mod
    (2 · sizes). The paper drops 15 of each of six shapes (section 2.3.3). Source: section 2.4. Default: 90. Range: ≥ 1
    and ≤ 100000."""
    density_kg_m3: float | None
    """Density of a fillet: its mass over its volume; null when `subparticle_density_kg_m3` is given. Unit: kg/m³.
    Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["centres", "whole_spheres"]
    """Lattice points that become sub-particles. `centres`: the centre is inside the shape. `whole_spheres`: the whole
    sphere is. Source: assumed. Default: "centres"."""
    mesh: MeshFile | MeshDigest | None
    """A closed mesh as the shape of all fillets. It replaces the teardrop shapes of `sizes_m`. Source: section 2.2.
    Default: null."""
    scale: float
    """Scale factor of fillets and sub-particles. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    shape: int | None
    """Shape of all fillets: 2 · (number of the size, from 0), plus 1 for its mirror image. Null: each shape in turn.
    Source: Fig. 1. Default: null. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float]]
    """Length, width and thickness of each size. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04], [0.172,
    0.072, 0.032], [0.176, 0.072, 0.04]]."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle, instead of `density_kg_m3`. The paper states both, but they contradict each other.
    Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The lattice spacing is 2R; half the radius makes eight times as many sub-particles.
    Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class BendProduct(TypedDict, total=False):
    """The fillets: number, size, shape and sub-particles."""

    density_kg_m3: float | None
    """Density of a fillet: its mass over its volume; null when `subparticle_density_kg_m3` is given. Unit: kg/m³.
    Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["centres", "whole_spheres"]
    """Lattice points that become sub-particles. `centres`: the centre is inside the shape. `whole_spheres`: the whole
    sphere is. Source: assumed. Default: "centres"."""
    mesh: MeshFile | MeshDigest | None
    """A closed mesh as the shape of all fillets. It replaces the teardrop shapes of `sizes_m`. Source: section 2.2.
    Default: null."""
    scale: float
    """Scale factor of fillets and sub-particles. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    shape: int | None
    """Shape of all fillets: 2 · (number of the size, from 0), plus 1 for its mirror image. Null: each shape in turn.
    Source: Fig. 1. Default: 2. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float]]
    """Length, width and thickness of each size. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04], [0.172,
    0.072, 0.032], [0.176, 0.072, 0.04]]."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle, instead of `density_kg_m3`. The paper states both, but they contradict each other.
    Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The lattice spacing is 2R; half the radius makes eight times as many sub-particles.
    Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class SlideProduct(TypedDict, total=False):
    """The fillets: number, size, shape and sub-particles."""

    density_kg_m3: float | None
    """Density of a fillet: its mass over its volume; null when `subparticle_density_kg_m3` is given. Unit: kg/m³.
    Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["centres", "whole_spheres"]
    """Lattice points that become sub-particles. `centres`: the centre is inside the shape. `whole_spheres`: the whole
    sphere is. Source: assumed. Default: "centres"."""
    mesh: MeshFile | MeshDigest | None
    """A closed mesh as the shape of all fillets. It replaces the teardrop shapes of `sizes_m`. Source: section 2.2.
    Default: null."""
    scale: float
    """Scale factor of fillets and sub-particles. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    shape: int | None
    """Shape of all fillets: 2 · (number of the size, from 0), plus 1 for its mirror image. Null: each shape in turn.
    Source: Fig. 1. Default: 2. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float]]
    """Length, width and thickness of each size. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04], [0.172,
    0.072, 0.032], [0.176, 0.072, 0.04]]."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle, instead of `density_kg_m3`. The paper states both, but they contradict each other.
    Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The lattice spacing is 2R; half the radius makes eight times as many sub-particles.
    Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class CompressProduct(TypedDict, total=False):
    """The fillets: number, size, shape and sub-particles."""

    density_kg_m3: float | None
    """Density of a fillet: its mass over its volume; null when `subparticle_density_kg_m3` is given. Unit: kg/m³.
    Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    scale: float
    """Scale factor of fillets and sub-particles. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle, instead of `density_kg_m3`. The paper states both, but they contradict each other.
    Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The lattice spacing is 2R; half the radius makes eight times as many sub-particles.
    Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class SceneProduct(TypedDict, total=False):
    """The fillets: number, size, shape and sub-particles."""

    density_kg_m3: float | None
    """Density of a fillet: its mass over its volume; null when `subparticle_density_kg_m3` is given. Unit: kg/m³.
    Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["centres", "whole_spheres"]
    """Lattice points that become sub-particles. `centres`: the centre is inside the shape. `whole_spheres`: the whole
    sphere is. Source: assumed. Default: "centres"."""
    mesh: MeshFile | MeshDigest | None
    """A closed mesh as the shape of all fillets. It replaces the teardrop shapes of `sizes_m`. Source: section 2.2.
    Default: null."""
    scale: float
    """Scale factor of fillets and sub-particles. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    sizes_m: Sequence[Sequence[float]]
    """Length, width and thickness of each size. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04], [0.172,
    0.072, 0.032], [0.176, 0.072, 0.04]]."""
    spheres: bool
    """Whether each body is one sphere of radius `subparticle_radius_m` with the density `density_kg_m3`, without bonds.
    It replaces the teardrop shapes of `sizes_m`, for grains and for comparisons with other codes. Source: assumed.
    Default: false."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle, instead of `density_kg_m3`. The paper states both, but they contradict each other.
    Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The lattice spacing is 2R; half the radius makes eight times as many sub-particles.
    Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class Drop(TypedDict, total=False):
    """Fillets that hit a plate, each by itself."""

    pitch_deg: float
    """Pitch: rotation about the fillet's width, after yaw; at 90 the fillet falls tail first. Unit: °. Source: Fig. 10.
    Default: 0.0. Range: ≥ -180 and ≤ 180."""
    roll_deg: float
    """Roll: rotation about the fillet's length, after pitch; at 90 the fillet falls on its side. Unit: °. Source: Fig.
    10. Default: 0.0. Range: ≥ -180 and ≤ 180."""
    scatter_deg: float
    """Maximum random deviation of each fillet's yaw, pitch and roll, drawn by `/seed`. Unit: °. Source: assumed.
    Default: 0.0. Range: ≥ 0 and ≤ 180."""
    speed_m_s: float
    """Speed at which fillets reach the plate, downwards; a free fall of 0.2 m reaches 2 m/s. Unit: m/s. Source: Fig.
    11. Default: 2.0. Range: ≥ 0 and ≤ 30."""
    yaw_deg: float
    """Yaw: rotation about the vertical. At yaw, pitch and roll of 0 the fillet lies flat, its length along x. Unit: °.
    Source: Fig. 10. Default: 0.0. Range: ≥ -180 and ≤ 180."""


class Bend(TypedDict, total=False):
    """A fillet that bends under its own weight."""

    bar_radius_m: float
    """Radius of the bar, or of the roller at the conveyor's end. Unit: m. Source: assumed. Default: 0.02. Range: ≥
    0.002 and ≤ 1."""
    belt_speed_m_s: float
    """Speed of the conveyor, for `off_ledge`. Unit: m/s. Source: section 2.4. Default: 0.25. Range: ≥ 0 and ≤ 10."""
    clamped_share: float
    """Share of the fillet's length that is held, for `clamped`. Source: assumed. Default: 0.25. Range: > 0 and < 1."""
    scatter_deg: float
    """Maximum random deviation of the fillet's yaw, drawn by `/seed`. Unit: °. Source: assumed. Default: 0.0. Range: ≥
    0 and ≤ 45."""
    support: Literal["over_bar", "off_ledge", "clamped"]
    """`over_bar`: across a bar, both ends hang. `off_ledge`: carried off the end of a conveyor. `clamped`: held at its
    blunt end. Source: section 2.3.2. Default: "over_bar"."""


class Slide(TypedDict, total=False):
    """A fillet on a plate that is tilted until it slides."""

    max_tilt_deg: float
    """Maximum tilt of the plate. Unit: °. Source: assumed. Default: 60.0. Range: ≥ 1 and ≤ 89."""
    scatter_deg: float
    """Maximum random deviation of the fillet's yaw, drawn by `/seed`. Unit: °. Source: assumed. Default: 0.0. Range: ≥
    0 and ≤ 180."""
    tilt_rate_deg_s: float
    """Tilt rate of the plate. Above 6 °/s the measured angle lags behind. Unit: °/s. Source: section 2.3.2. Default:
    3.0. Range: ≥ 0.1 and ≤ 30."""
    yaw_deg: float
    """Direction of the fillet on the plate; at 0 its length points up the slope. Unit: °. Source: assumed. Default:
    0.0. Range: ≥ -180 and ≤ 180."""


class Compress(TypedDict, total=False):
    """A block of tissue between two plates."""

    lattice: Sequence[int]
    """Sub-particles of the block along x, y and z. 10 × 10 × 3 with a radius of 1.75 mm are 35 × 35 × 10.5 mm. Source:
    section 2.3.2. Default: [10, 10, 3]."""
    max_strain: float
    """Strain, from first contact on, at which the test ends. Source: Fig. 6. Default: 0.06. Range: > 0 and ≤ 0.5."""
    modulus_from_strain: float
    """Start of the strain range to which the modulus is fitted. Source: section 3.1. Default: 0.0. Range: ≥ 0 and ≤
    0.5."""
    modulus_to_strain: float
    """End of the strain range to which the modulus is fitted. Source: section 3.1. Default: 0.03. Range: > 0 and ≤ 0.5.
    """
    plates: Literal["rough", "frictionless"]
    """`rough`: plates with the friction of the equipment. `frictionless`: plates without friction. Source: assumed.
    Default: "rough"."""
    strain_rate_1_s: float
    """Rate of strain; the paper's 1 mm/min on 10 mm is 0.0017 1/s. Unit: 1/s. Source: assumed. Default: 0.05. Range: >
    0 and ≤ 10."""


class Scene(TypedDict, total=False):
    """Bodies and surfaces, freely placed."""

    bodies: Sequence[SceneBodiesItem]
    """Fillets: shape, place, orientation and velocity."""
    gravity_direction: Sequence[float]
    """Direction of gravity, of any length; `/numerics/gravity_m_s2` is the acceleration. Source: assumed. Default:
    [0.0, 0.0, -1.0]."""
    margin_m: float
    """A sub-particle leaves the simulation at this distance outside the bounding box of the scene at the start. Unit:
    m. Source: numerics. Default: 0.5. Range: > 0 and ≤ 10."""
    surfaces: Sequence[SceneSurfacesItem]
    """Surfaces of triangles that move together."""


class HopperScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """The bonds between the sub-particles of a fillet."""
    contact: HopperContact
    """The contacts between fillets and with the equipment."""
    equipment: HopperEquipment
    """Hopper, gate and belt. The dimensions of Fig. 5 are derived."""
    experiment: Required[Literal["hopper"]]
    """What is simulated: bulk discharge of a hopper (section 2.4), one of the paper's tests of single fillets (section
    2.3), or a `scene` of bodies and surfaces that you place. Source: section 2."""
    material: Material
    """Elastic constants of the tissue."""
    numerics: HopperNumerics
    """Time step, duration, sampling and stopping."""
    product: HopperProduct
    """The fillets: number, size, shape and sub-particles."""
    schema: Literal["roost.scenario/2"]
    """Name and version of this document's format. `roost.scenario/1` is read as well; its bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers; at most 2⁵³ − 1. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""


class DropScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """The bonds between the sub-particles of a fillet."""
    contact: DropContact
    """The contacts between fillets and with the equipment."""
    drop: Drop
    """Fillets that hit a plate, each by itself."""
    experiment: Required[Literal["drop"]]
    """What is simulated: bulk discharge of a hopper (section 2.4), one of the paper's tests of single fillets (section
    2.3), or a `scene` of bodies and surfaces that you place. Source: section 2."""
    material: Material
    """Elastic constants of the tissue."""
    numerics: DropNumerics
    """Time step, duration, sampling and stopping."""
    product: DropProduct
    """The fillets: number, size, shape and sub-particles."""
    schema: Literal["roost.scenario/2"]
    """Name and version of this document's format. `roost.scenario/1` is read as well; its bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers; at most 2⁵³ − 1. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""


class BendScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bend: Bend
    """A fillet that bends under its own weight."""
    bonds: Bonds
    """The bonds between the sub-particles of a fillet."""
    contact: BendContact
    """The contacts between fillets and with the equipment."""
    experiment: Required[Literal["bend"]]
    """What is simulated: bulk discharge of a hopper (section 2.4), one of the paper's tests of single fillets (section
    2.3), or a `scene` of bodies and surfaces that you place. Source: section 2."""
    material: Material
    """Elastic constants of the tissue."""
    numerics: BendNumerics
    """Time step, duration, sampling and stopping."""
    product: BendProduct
    """The fillets: number, size, shape and sub-particles."""
    schema: Literal["roost.scenario/2"]
    """Name and version of this document's format. `roost.scenario/1` is read as well; its bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers; at most 2⁵³ − 1. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""


class SlideScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """The bonds between the sub-particles of a fillet."""
    contact: SlideContact
    """The contacts between fillets and with the equipment."""
    experiment: Required[Literal["slide"]]
    """What is simulated: bulk discharge of a hopper (section 2.4), one of the paper's tests of single fillets (section
    2.3), or a `scene` of bodies and surfaces that you place. Source: section 2."""
    material: Material
    """Elastic constants of the tissue."""
    numerics: SlideNumerics
    """Time step, duration, sampling and stopping."""
    product: SlideProduct
    """The fillets: number, size, shape and sub-particles."""
    schema: Literal["roost.scenario/2"]
    """Name and version of this document's format. `roost.scenario/1` is read as well; its bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers; at most 2⁵³ − 1. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""
    slide: Slide
    """A fillet on a plate that is tilted until it slides."""


class CompressScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """The bonds between the sub-particles of a fillet."""
    compress: Compress
    """A block of tissue between two plates."""
    contact: CompressContact
    """The contacts between fillets and with the equipment."""
    experiment: Required[Literal["compress"]]
    """What is simulated: bulk discharge of a hopper (section 2.4), one of the paper's tests of single fillets (section
    2.3), or a `scene` of bodies and surfaces that you place. Source: section 2."""
    material: Material
    """Elastic constants of the tissue."""
    numerics: CompressNumerics
    """Time step, duration, sampling and stopping."""
    product: CompressProduct
    """The fillets: number, size, shape and sub-particles."""
    schema: Literal["roost.scenario/2"]
    """Name and version of this document's format. `roost.scenario/1` is read as well; its bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers; at most 2⁵³ − 1. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""


class SceneScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """The bonds between the sub-particles of a fillet."""
    contact: SceneContact
    """The contacts between fillets and with the equipment."""
    experiment: Required[Literal["scene"]]
    """What is simulated: bulk discharge of a hopper (section 2.4), one of the paper's tests of single fillets (section
    2.3), or a `scene` of bodies and surfaces that you place. Source: section 2."""
    material: Material
    """Elastic constants of the tissue."""
    numerics: SceneNumerics
    """Time step, duration, sampling and stopping."""
    product: SceneProduct
    """The fillets: number, size, shape and sub-particles."""
    scene: Scene
    """Bodies and surfaces, freely placed."""
    schema: Literal["roost.scenario/2"]
    """Name and version of this document's format. `roost.scenario/1` is read as well; its bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers; at most 2⁵³ − 1. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""


ScenarioDocument: TypeAlias = Union[HopperScenario, DropScenario, BendScenario, SlideScenario, CompressScenario, SceneScenario]
"""The scenario of any experiment."""
