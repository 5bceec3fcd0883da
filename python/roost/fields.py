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
    """This list has further surfaces, with the same fields as `/scene/surfaces`."""

    kind: Literal["equipment", "belt", "frictionless"]
    """Contact parameters of the surface. `equipment`: the parameters of `/contact/fillet_equipment`. `belt`: the
    parameters of `/contact/fillet_belt`. `frictionless`: as `equipment`, but without friction. Source: Table 2.
    Default: "equipment"."""
    mesh: MeshFile | MeshDigest | None
    """Triangles from an STL file. Give either `mesh` or `plate_m`. If the normals of a closed part point outwards, the
    part is solid. If a closed box contains the fillets, its normals must point inwards. Source: assumed. Default: null.
    """
    motion: Literal["fixed", "belt", "moving"]
    """Motion from t = 0 on. `fixed`: no motion. `belt`: the surface stays in its place, and its material runs like a
    belt. `moving`: the surface moves and turns. Source: assumed. Default: "fixed"."""
    name: Required[str]
    """Name of the surface in messages and series. Two surfaces must not have the same name. Source: assumed."""
    orientation_deg: Sequence[float]
    """Rotation of the surface about `position_m`: yaw, pitch and roll. Unit: °. Source: assumed. Default: [0.0, 0.0,
    0.0]."""
    pivot_m: Sequence[float]
    """With the motion `moving`: position at t = 0 of the pivot, the point about which the surface turns. Unit: m.
    Source: assumed. Default: [0.0, 0.0, 0.0]."""
    plate_m: Sequence[Sequence[float]] | None
    """A flat parallelogram: a corner, and two edges as vectors from this corner. Unit: m. Source: assumed. Default:
    null."""
    position_m: Sequence[float]
    """Position of the surface: the point at which the origin of its triangles is placed. Unit: m. Source: assumed.
    Default: [0.0, 0.0, 0.0]."""
    presence: Literal["always", "until_start"]
    """Time during which the surface exists. `always`: the whole simulation. `until_start`: until t = 0, like a shutter.
    Source: assumed. Default: "always"."""
    spin_deg_s: Sequence[float]
    """With the motion `moving`: angular velocity about the pivot. Unit: °/s. Source: assumed. Default: [0.0, 0.0, 0.0].
    """
    static_friction: float | None
    """Coulomb coefficient of friction of this surface. Null: the coefficient of its `kind`. Source: assumed. Default:
    null. Range: ≥ 0 and ≤ 5."""
    velocity_m_s: Sequence[float]
    """With the motion `belt`: velocity of the material. With the motion `moving`: velocity of the pivot. Unit: m/s.
    Source: assumed. Default: [0.0, 0.0, 0.0]."""


class SceneBodiesItem(TypedDict, total=False):
    """This list has the bodies, with their shape, position, orientation and velocity."""

    orientation_deg: Sequence[float]
    """Rotation of the body: yaw about z, then pitch about its width, then roll about its length. Unit: °. Source:
    assumed. Default: [0.0, 0.0, 0.0]."""
    position_m: Required[Sequence[float]]
    """Position of the body's centre of mass at the start. Unit: m. Source: assumed."""
    shape: int
    """Shape of the body: 2 · (number of the size in `/product/sizes_m`, counted from 0), plus 1 for the mirror image.
    Source: Fig. 1. Default: 0. Range: ≥ 0 and ≤ 63."""
    velocity_m_s: Sequence[float]
    """Velocity at the start. Unit: m/s. Source: assumed. Default: [0.0, 0.0, 0.0]."""


class SceneSurfacesItem(TypedDict, total=False):
    """This list has the surfaces. The triangles of a surface move together."""

    kind: Literal["equipment", "belt", "frictionless"]
    """Contact parameters of the surface. `equipment`: the parameters of `/contact/fillet_equipment`. `belt`: the
    parameters of `/contact/fillet_belt`. `frictionless`: as `equipment`, but without friction. Source: Table 2.
    Default: "equipment"."""
    mesh: MeshFile | MeshDigest | None
    """Triangles from an STL file. Give either `mesh` or `plate_m`. If the normals of a closed part point outwards, the
    part is solid. If a closed box contains the fillets, its normals must point inwards. Source: assumed. Default: null.
    """
    motion: Literal["fixed", "belt", "moving"]
    """Motion from t = 0 on. `fixed`: no motion. `belt`: the surface stays in its place, and its material runs like a
    belt. `moving`: the surface moves and turns. Source: assumed. Default: "fixed"."""
    name: Required[str]
    """Name of the surface in messages and series. Two surfaces must not have the same name. Source: assumed."""
    orientation_deg: Sequence[float]
    """Rotation of the surface about `position_m`: yaw, pitch and roll. Unit: °. Source: assumed. Default: [0.0, 0.0,
    0.0]."""
    pivot_m: Sequence[float]
    """With the motion `moving`: position at t = 0 of the pivot, the point about which the surface turns. Unit: m.
    Source: assumed. Default: [0.0, 0.0, 0.0]."""
    plate_m: Sequence[Sequence[float]] | None
    """A flat parallelogram: a corner, and two edges as vectors from this corner. Unit: m. Source: assumed. Default:
    null."""
    position_m: Sequence[float]
    """Position of the surface: the point at which the origin of its triangles is placed. Unit: m. Source: assumed.
    Default: [0.0, 0.0, 0.0]."""
    presence: Literal["always", "until_start"]
    """Time during which the surface exists. `always`: the whole simulation. `until_start`: until t = 0, like a shutter.
    Source: assumed. Default: "always"."""
    spin_deg_s: Sequence[float]
    """With the motion `moving`: angular velocity about the pivot. Unit: °/s. Source: assumed. Default: [0.0, 0.0, 0.0].
    """
    static_friction: float | None
    """Coulomb coefficient of friction of this surface. Null: the coefficient of its `kind`. Source: assumed. Default:
    null. Range: ≥ 0 and ≤ 5."""
    velocity_m_s: Sequence[float]
    """With the motion `belt`: velocity of the material. With the motion `moving`: velocity of the pivot. Unit: m/s.
    Source: assumed. Default: [0.0, 0.0, 0.0]."""


class ContactFilletBelt(TypedDict, total=False):
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""

    restitution: float
    """Coefficient of restitution on the belt. Default: that of /contact/fillet_fillet/restitution. Source: assumed.
    Range: > 0 and ≤ 1."""
    static_friction: float
    """Coulomb coefficient of friction on the belt. The paper did not measure this coefficient. Dry: the value for a
    steel plate. Wet: a value so low that the belt slips under the fillets, as section 3.4 reports. Default when wet:
    0.2. Source: assumed. Default: 0.5. Range: ≥ 0 and ≤ 5."""
    surface_energy_j_m2: float
    """Surface energy γ on the belt. Unit: J/m². Default: that of /contact/fillet_fillet/surface_energy_j_m2. Source:
    assumed. Range: ≥ 0 and ≤ 10."""


class ContactFilletEquipment(TypedDict, total=False):
    """These values apply to contacts of sub-particles with walls, gates and plates."""

    restitution: float
    """Coefficient of restitution on walls, gates and plates. Default: that of /contact/fillet_fillet/restitution.
    Source: Table 2. Range: > 0 and ≤ 1."""
    static_friction: float
    """Coulomb coefficient of friction on walls, gates and plates. The coefficient is equal for dry and wet fillets
    (Fig. 8b). Source: Table 2. Default: 0.5. Range: ≥ 0 and ≤ 5."""
    surface_energy_j_m2: float
    """Surface energy γ on walls, gates and plates. Unit: J/m². Default: that of
    /contact/fillet_fillet/surface_energy_j_m2. Source: Table 2. Range: ≥ 0 and ≤ 10."""


class ContactFilletFillet(TypedDict, total=False):
    """These values apply to contacts between sub-particles."""

    restitution: float
    """Coefficient of restitution between fillets. Source: Table 2. Default: 0.0001. Range: > 0 and ≤ 1."""
    static_friction: float
    """Coulomb coefficient of friction between fillets. Source: Table 2. Default: 0.1. Range: ≥ 0 and ≤ 5."""
    surface_energy_j_m2: float
    """Surface energy γ between fillets. Wet: the surface tension of water at 20 °C (assumed). Unit: J/m². Default when
    wet: 0.0728. Source: Table 2. Default: 0.055. Range: ≥ 0 and ≤ 10."""


class HopperNumericsStop(TypedDict, total=False):
    """These conditions end a simulation before its duration is over."""

    when_empty: bool
    """Whether the simulation ends when nothing is left. In a hopper, every fillet has then passed the gate. In a scene,
    every body has then left the simulated space. Source: numerics. Default: true."""
    when_jammed_s: float | None
    """The simulation ends when nothing has passed the gate for this time, even if little mass is left inside. Null: a
    jam does not end the simulation. Unit: s. Source: numerics. Default: null. Range: > 0 and ≤ 600."""


class DropNumericsStop(TypedDict, total=False):
    """These conditions end a simulation before its duration is over."""

    when_done: bool
    """Whether the simulation ends as soon as its result is known. For example: the fillets rest, the fillet slides, or
    the block is compressed. Source: numerics. Default: true."""


class BendNumericsStop(TypedDict, total=False):
    """These conditions end a simulation before its duration is over."""

    when_done: bool
    """Whether the simulation ends as soon as its result is known. For example: the fillets rest, the fillet slides, or
    the block is compressed. Source: numerics. Default: true."""


class SlideNumericsStop(TypedDict, total=False):
    """These conditions end a simulation before its duration is over."""

    when_done: bool
    """Whether the simulation ends as soon as its result is known. For example: the fillets rest, the fillet slides, or
    the block is compressed. Source: numerics. Default: true."""


class CompressNumericsStop(TypedDict, total=False):
    """These conditions end a simulation before its duration is over."""

    when_done: bool
    """Whether the simulation ends as soon as its result is known. For example: the fillets rest, the fillet slides, or
    the block is compressed. Source: numerics. Default: true."""


class SceneNumericsStop(TypedDict, total=False):
    """These conditions end a simulation before its duration is over."""

    when_done: bool
    """Whether the simulation ends as soon as its result is known. For example: the fillets rest, the fillet slides, or
    the block is compressed. Source: numerics. Default: false."""
    when_empty: bool
    """Whether the simulation ends when nothing is left. In a hopper, every fillet has then passed the gate. In a scene,
    every body has then left the simulated space. Source: numerics. Default: true."""


class Bonds(TypedDict, total=False):
    """This section describes the bonds between the sub-particles of a body."""

    contact_between_bonded: bool
    """Whether a contact force also acts between two sub-particles that a bond joins. The commercial software that the
    paper used computes this force. Source: assumed. Default: true."""
    contact_radius_ratio: float
    """Contact radius divided by the radius of a sub-particle. A bond breaks when it is longer than twice the contact
    radius. Keep the ratio below √3. Source: Table 2. Default: 1.732. Range: > 1 and ≤ 1.732."""
    disk_scale: float
    """Radius R_b of the cross-section of a bond, divided by the radius R of a sub-particle. Source: assumed. Default:
    1.0. Range: > 0 and ≤ 2."""
    formulation: Literal["corotated", "as_published", "finite_extension"]
    """Rule for the bond force. `corotated`: the force turns with the bond. `as_published`: the force keeps its
    direction. `finite_extension`: as `corotated`, but the bond becomes stiffer before it breaks. Source: eq. 6.
    Default: "corotated"."""
    moment_stiffness_factor: float
    """Factor of the bending and twisting stiffness of a bond. 0: bonds carry no moments, as in the paper. 1: the
    bending stiffness is S_n I and the twisting stiffness is S_t J, as for the parallel bond of Potyondy and Cundall
    2004. I and J are the second moments of area of the bond's cross-section, for bending and twisting. Source: assumed.
    Default: 0.0. Range: ≥ 0 and ≤ 10."""
    normal_stiffness_n_m3: float
    """Stiffness S_n of a bond along its length, per cross-section area of the bond. Unit: N/m³. Source: Table 2.
    Default: 1000000.0. Range: > 0 and ≤ 1000000000000."""
    normal_strength_pa: float | None
    """Stress along a bond at which the bond breaks. Null: stress along the bond never breaks the bond. Unit: Pa.
    Source: Table 2 has 1e300. Default: null. Range: > 0 and ≤ 1e+300."""
    reference_radius_m: float | None
    """Radius R_ref of the sub-particles for which S_n and S_t are given. At another radius R, Roost multiplies S_n and
    S_t by R_ref / R, so that the lattice keeps its modulus. Null: Roost uses S_n and S_t unchanged at every radius.
    Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""
    shear_stiffness_n_m3: float
    """Stiffness S_t of a bond across its length (shear), per cross-section area of the bond. Unit: N/m³. Source: Table
    2. Default: 600000.0. Range: ≥ 0 and ≤ 1000000000000."""
    shear_strength_pa: float | None
    """Shear stress at which a bond breaks. Null: shear stress never breaks the bond. Unit: Pa. Source: Table 2 has
    1e300. Default: null. Range: > 0 and ≤ 1e+300."""
    types: int
    """Number of types of sub-particles (Fig. 2). With two types, bonds join only sub-particles of different types. The
    two types alternate, so these bonds lie along the edges of the lattice. With one type, bonds also lie along the
    diagonals that are shorter than twice the contact radius. Source: section 2.2. Default: 2. Range: ≥ 1 and ≤ 2."""


class HopperContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` changes two defaults: the surface energy between fillets and the friction on the
    belt. If you write a value yourself, Roost uses your value. Source: section 2.4. Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between sub-particles."""
    fillet_fillet_radius_ratio: float
    """Radius of a sub-particle in contacts with other fillets, divided by `/product/subparticle_radius_m`. With the
    value 1, a sub-particle of one fillet can slip between the sub-particles of another fillet. With the value 1.225, a
    sub-particle is too large to slip through. Source: assumed. Default: 1.0. Range: ≥ 1 and ≤ 1.5."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, the energy is γ
    R/R₀. The maximum pull per area of equipment is then 3πγ/(4 R₀). Like the pull of a liquid film, it does not depend
    on R. Null: the energy is γ at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class DropContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` changes two defaults: the surface energy between fillets and the friction on the
    belt. If you write a value yourself, Roost uses your value. Source: section 2.4. Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, the energy is γ
    R/R₀. The maximum pull per area of equipment is then 3πγ/(4 R₀). Like the pull of a liquid film, it does not depend
    on R. Null: the energy is γ at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class BendContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` changes two defaults: the surface energy between fillets and the friction on the
    belt. If you write a value yourself, Roost uses your value. Source: section 2.4. Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, the energy is γ
    R/R₀. The maximum pull per area of equipment is then 3πγ/(4 R₀). Like the pull of a liquid film, it does not depend
    on R. Null: the energy is γ at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class SlideContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` changes two defaults: the surface energy between fillets and the friction on the
    belt. If you write a value yourself, Roost uses your value. Source: section 2.4. Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, the energy is γ
    R/R₀. The maximum pull per area of equipment is then 3πγ/(4 R₀). Like the pull of a liquid film, it does not depend
    on R. Null: the energy is γ at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class CompressContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` changes two defaults: the surface energy between fillets and the friction on the
    belt. If you write a value yourself, Roost uses your value. Source: section 2.4. Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, the energy is γ
    R/R₀. The maximum pull per area of equipment is then 3πγ/(4 R₀). Like the pull of a liquid film, it does not depend
    on R. Null: the energy is γ at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class SceneContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets. `wet` changes two defaults: the surface energy between fillets and the friction on the
    belt. If you write a value yourself, Roost uses your value. Source: section 2.4. Default: "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between sub-particles."""
    fillet_fillet_radius_ratio: float
    """Radius of a sub-particle in contacts with other fillets, divided by `/product/subparticle_radius_m`. With the
    value 1, a sub-particle of one fillet can slip between the sub-particles of another fillet. With the value 1.225, a
    sub-particle is too large to slip through. Source: assumed. Default: 1.0. Range: ≥ 1 and ≤ 1.5."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, the energy is γ
    R/R₀. The maximum pull per area of equipment is then 3πγ/(4 R₀). Like the pull of a liquid film, it does not depend
    on R. Null: the energy is γ at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class HopperEquipment(TypedDict, total=False):
    """This section describes the hopper, the gate and the belt. The dimensions of Fig. 5 are derived from other numbers
    of the paper."""

    belt_speed_m_s: float
    """Speed of the belt from t = 0 on. The paper's belt runs at 15 m/min. If `parametric` is false, the speed of the
    belt comes from `surfaces`. Unit: m/s. Source: section 2.4. Default: 0.25. Range: ≥ 0 and ≤ 10."""
    feed_kg_s: float
    """Mass per second of the fillets that enter from above, from t = 0 on. The fillets start at the height
    `hopper_height_m`, at random positions where they touch nothing. 0: no feed. Unit: kg/s. Source: assumed. Default:
    0.0. Range: ≥ 0 and ≤ 1000."""
    gate_opening_m: float
    """Height of the gate's lower edge above the belt. If `parametric` is false, this field has no effect: see
    `opening_height_m`. Roost then accepts only the default and the value of `opening_height_m`. Unit: m. Source: Fig.
    5. Default: 0.06. Range: ≥ 0.001 and ≤ 5."""
    hopper_height_m: float
    """Height of the hopper walls above the belt. Unit: m. Source: assumed. Default: 0.5. Range: ≥ 0.01 and ≤ 10."""
    hopper_length_m: float
    """Inner length of the hopper along the belt (x), measured at the belt. Unit: m. Source: derived. Default: 0.3.
    Range: ≥ 0.01 and ≤ 10."""
    hopper_width_m: float
    """Inner width of the hopper across the belt (y), derived from the paper's discharge of 33.2 kg in 4 s. Unit: m.
    Source: derived. Default: 0.59. Range: ≥ 0.01 and ≤ 10."""
    opening_height_m: float | None
    """Height of the gate's lower edge above the belt, if `parametric` is false. Null: the result has no belt capacity
    and no `regime`. Unit: m. Source: assumed. Default: null. Range: ≥ 0.001 and ≤ 5."""
    opening_width_m: float | None
    """Inner width of the opening under the gate, if `parametric` is false. Null: the result has no belt capacity and no
    `regime`. Unit: m. Source: assumed. Default: null. Range: ≥ 0.001 and ≤ 10."""
    parametric: bool
    """True: Roost makes the belt, the walls, the gate and the shutter from the fields of this table. False: the hopper
    consists only of `surfaces`. Source: assumed. Default: true."""
    shutter_while_filling: bool
    """Whether a shutter closes the opening until the belt starts. Source: assumed. Default: true."""
    side_walls: Literal["rough", "frictionless", "periodic"]
    """Kind of the two walls along the belt. `rough`: walls with the friction of the equipment. `frictionless`: walls
    without friction, for a slice of a wide hopper. `periodic`: no walls; a fillet that leaves on one side enters on the
    other side. Source: section 2.4. Default: "rough"."""
    surface_loads: bool
    """Whether the result has the series of force and torque on each surface. With these series, the result is ten times
    as large as without the series. Source: numerics. Default: false."""
    surfaces: Sequence[HopperEquipmentSurfacesItem]
    """This list has further surfaces, with the same fields as `/scene/surfaces`."""
    wall_slope_deg: float
    """Angle between the back wall and the vertical; the hopper widens upwards. Unit: °. Source: assumed. Default: 0.0.
    Range: ≥ 0 and ≤ 80."""


class Material(TypedDict, total=False):
    """This section has the elastic constants of the tissue."""

    poisson_ratio: float
    """Poisson's ratio of the tissue. Source: Table 2. Default: 0.37. Range: > -1 and < 0.5."""
    youngs_modulus_pa: float
    """Young's modulus of the tissue. Unit: Pa. Source: Table 2. Default: 48600.0. Range: ≥ 100 and ≤ 10000000000."""


class HopperNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the sampling and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. Use the value true only to study stability. Source:
    numerics. Default: false."""
    duration_s: float
    """Simulated time from t = 0 on. At t = 0 the belt or the test starts. Unit: s. Source: numerics. Default: 6.0.
    Range: > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards. The default in `compress` is 0, because the weight of the block would distort
    the curve. Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    jam_after_s: float
    """A hopper has jammed when nothing passes the gate for this time, while at least 5 % of the filled mass is inside.
    If `when_jammed_s` is shorter than this time, Roost uses `when_jammed_s` instead. Unit: s. Source: numerics.
    Default: 1.0. Range: > 0 and ≤ 600."""
    max_fill_s: float
    """If the fillets are not at rest after this time, the simulation ends. Unit: s. Source: numerics. Default: 10.0.
    Range: > 0 and ≤ 600."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The fillets are at rest when 99.9 % of the sub-particles are slower than this speed. Then the belt or the test
    starts. Unit: m/s. Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """If a sub-particle is faster than this speed, the simulation ends as `unstable`. Unit: m/s. Source: numerics.
    Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: HopperNumericsStop
    """These conditions end a simulation before its duration is over."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: Roost computes a time step safely below the stability limit, from stiffness, mass, damping and
    the speed at the start. Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class DropNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the sampling and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. Use the value true only to study stability. Source:
    numerics. Default: false."""
    duration_s: float
    """Simulated time from t = 0 on. At t = 0 the belt or the test starts. Unit: s. Source: numerics. Default: 2.0.
    Range: > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards. The default in `compress` is 0, because the weight of the block would distort
    the curve. Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.002. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The fillets are at rest when 99.9 % of the sub-particles are slower than this speed. Then the belt or the test
    starts. Unit: m/s. Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """If a sub-particle is faster than this speed, the simulation ends as `unstable`. Unit: m/s. Source: numerics.
    Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: DropNumericsStop
    """These conditions end a simulation before its duration is over."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: Roost computes a time step safely below the stability limit, from stiffness, mass, damping and
    the speed at the start. Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class BendNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the sampling and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. Use the value true only to study stability. Source:
    numerics. Default: false."""
    duration_s: float
    """Simulated time from t = 0 on. At t = 0 the belt or the test starts. Unit: s. Source: numerics. Default: 5.0.
    Range: > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards. The default in `compress` is 0, because the weight of the block would distort
    the curve. Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    max_fill_s: float
    """If the fillets are not at rest after this time, the simulation ends. Unit: s. Source: numerics. Default: 10.0.
    Range: > 0 and ≤ 600."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The fillets are at rest when 99.9 % of the sub-particles are slower than this speed. Then the belt or the test
    starts. Unit: m/s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """If a sub-particle is faster than this speed, the simulation ends as `unstable`. Unit: m/s. Source: numerics.
    Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: BendNumericsStop
    """These conditions end a simulation before its duration is over."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: Roost computes a time step safely below the stability limit, from stiffness, mass, damping and
    the speed at the start. Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class SlideNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the sampling and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. Use the value true only to study stability. Source:
    numerics. Default: false."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards. The default in `compress` is 0, because the weight of the block would distort
    the curve. Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    max_fill_s: float
    """If the fillets are not at rest after this time, the simulation ends. Unit: s. Source: numerics. Default: 10.0.
    Range: > 0 and ≤ 600."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The fillets are at rest when 99.9 % of the sub-particles are slower than this speed. Then the belt or the test
    starts. Unit: m/s. Source: numerics. Default: 0.01. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """If a sub-particle is faster than this speed, the simulation ends as `unstable`. Unit: m/s. Source: numerics.
    Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: SlideNumericsStop
    """These conditions end a simulation before its duration is over."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: Roost computes a time step safely below the stability limit, from stiffness, mass, damping and
    the speed at the start. Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class CompressNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the sampling and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. Use the value true only to study stability. Source:
    numerics. Default: false."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards. The default in `compress` is 0, because the weight of the block would distort
    the curve. Unit: m/s². Source: assumed. Default: 0.0. Range: ≥ 0 and ≤ 100."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The fillets are at rest when 99.9 % of the sub-particles are slower than this speed. Then the belt or the test
    starts. Unit: m/s. Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """If a sub-particle is faster than this speed, the simulation ends as `unstable`. Unit: m/s. Source: numerics.
    Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: CompressNumericsStop
    """These conditions end a simulation before its duration is over."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: Roost computes a time step safely below the stability limit, from stiffness, mass, damping and
    the speed at the start. Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class SceneNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the sampling and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. Use the value true only to study stability. Source:
    numerics. Default: false."""
    duration_s: float
    """Simulated time from t = 0 on. At t = 0 the belt or the test starts. Unit: s. Source: numerics. Default: 2.0.
    Range: > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity, downwards. The default in `compress` is 0, because the weight of the block would distort
    the curve. Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """The fillets are at rest when 99.9 % of the sub-particles are slower than this speed. Then the belt or the test
    starts. Unit: m/s. Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """If a sub-particle is faster than this speed, the simulation ends as `unstable`. Unit: m/s. Source: numerics.
    Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: SceneNumericsStop
    """These conditions end a simulation before its duration is over."""
    timestep_s: float | Literal["auto"]
    """Time step. `auto`: Roost computes a time step safely below the stability limit, from stiffness, mass, damping and
    the speed at the start. Unit: s. Source: Table 2. Default: 5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class HopperProduct(TypedDict, total=False):
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""

    count: int
    """Number of fillets. If `shape` is null, Roost uses all sizes and their mirror images in turn: fillet i has the
    shape i mod (2 · number of sizes). The paper's drop test has 15 fillets of each of six shapes (section 2.3.3).
    Source: section 2.4. Default: 191. Range: ≥ 1 and ≤ 100000."""
    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. The value is null if you set
    `subparticle_density_kg_m3`. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["centres", "whole_spheres"]
    """Rule that decides which lattice points become sub-particles. `centres`: the points inside the shape.
    `whole_spheres`: the points whose whole sphere of radius R is inside the shape. Source: assumed. Default: "centres".
    """
    mesh: MeshFile | MeshDigest | None
    """A closed mesh (STL file) as the shape of all fillets. The mesh replaces the teardrop shapes of `sizes_m`. Source:
    section 2.2. Default: null."""
    scale: float
    """Factor by which the lengths of bodies and sub-particles are multiplied. Source: Fig. 12. Default: 1.0. Range: ≥
    0.05 and ≤ 20."""
    shape: int | None
    """Shape of all fillets: 2 · (number of the size in `sizes_m`, counted from 0), plus 1 for the mirror image. Null:
    Roost uses all shapes in turn. Source: Fig. 1. Default: null. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float]]
    """Length, width and thickness of each size. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04], [0.172,
    0.072, 0.032], [0.176, 0.072, 0.04]]."""
    spheres: bool
    """True: each body is one sphere of radius `subparticle_radius_m` and density `density_kg_m3`, without bonds. Use
    the value true for grains, and for comparisons with other programs. False: bodies have the shapes of `sizes_m` or
    `mesh`. Source: assumed. Default: false."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. If you set this field, do not set `density_kg_m3`. The paper states both densities,
    but the two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤
    20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The centres of neighbouring sub-particles have the distance 2R. With half the radius,
    a body has eight times as many sub-particles. Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤
    0.05."""


class DropProduct(TypedDict, total=False):
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""

    count: int
    """Number of fillets. If `shape` is null, Roost uses all sizes and their mirror images in turn: fillet i has the
    shape i mod (2 · number of sizes). The paper's drop test has 15 fillets of each of six shapes (section 2.3.3).
    Source: section 2.4. Default: 90. Range: ≥ 1 and ≤ 100000."""
    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. The value is null if you set
    `subparticle_density_kg_m3`. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["centres", "whole_spheres"]
    """Rule that decides which lattice points become sub-particles. `centres`: the points inside the shape.
    `whole_spheres`: the points whose whole sphere of radius R is inside the shape. Source: assumed. Default: "centres".
    """
    mesh: MeshFile | MeshDigest | None
    """A closed mesh (STL file) as the shape of all fillets. The mesh replaces the teardrop shapes of `sizes_m`. Source:
    section 2.2. Default: null."""
    scale: float
    """Factor by which the lengths of bodies and sub-particles are multiplied. Source: Fig. 12. Default: 1.0. Range: ≥
    0.05 and ≤ 20."""
    shape: int | None
    """Shape of all fillets: 2 · (number of the size in `sizes_m`, counted from 0), plus 1 for the mirror image. Null:
    Roost uses all shapes in turn. Source: Fig. 1. Default: null. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float]]
    """Length, width and thickness of each size. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04], [0.172,
    0.072, 0.032], [0.176, 0.072, 0.04]]."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. If you set this field, do not set `density_kg_m3`. The paper states both densities,
    but the two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤
    20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The centres of neighbouring sub-particles have the distance 2R. With half the radius,
    a body has eight times as many sub-particles. Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤
    0.05."""


class BendProduct(TypedDict, total=False):
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""

    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. The value is null if you set
    `subparticle_density_kg_m3`. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["centres", "whole_spheres"]
    """Rule that decides which lattice points become sub-particles. `centres`: the points inside the shape.
    `whole_spheres`: the points whose whole sphere of radius R is inside the shape. Source: assumed. Default: "centres".
    """
    mesh: MeshFile | MeshDigest | None
    """A closed mesh (STL file) as the shape of all fillets. The mesh replaces the teardrop shapes of `sizes_m`. Source:
    section 2.2. Default: null."""
    scale: float
    """Factor by which the lengths of bodies and sub-particles are multiplied. Source: Fig. 12. Default: 1.0. Range: ≥
    0.05 and ≤ 20."""
    shape: int | None
    """Shape of all fillets: 2 · (number of the size in `sizes_m`, counted from 0), plus 1 for the mirror image. Null:
    Roost uses all shapes in turn. Source: Fig. 1. Default: 2. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float]]
    """Length, width and thickness of each size. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04], [0.172,
    0.072, 0.032], [0.176, 0.072, 0.04]]."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. If you set this field, do not set `density_kg_m3`. The paper states both densities,
    but the two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤
    20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The centres of neighbouring sub-particles have the distance 2R. With half the radius,
    a body has eight times as many sub-particles. Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤
    0.05."""


class SlideProduct(TypedDict, total=False):
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""

    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. The value is null if you set
    `subparticle_density_kg_m3`. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["centres", "whole_spheres"]
    """Rule that decides which lattice points become sub-particles. `centres`: the points inside the shape.
    `whole_spheres`: the points whose whole sphere of radius R is inside the shape. Source: assumed. Default: "centres".
    """
    mesh: MeshFile | MeshDigest | None
    """A closed mesh (STL file) as the shape of all fillets. The mesh replaces the teardrop shapes of `sizes_m`. Source:
    section 2.2. Default: null."""
    scale: float
    """Factor by which the lengths of bodies and sub-particles are multiplied. Source: Fig. 12. Default: 1.0. Range: ≥
    0.05 and ≤ 20."""
    shape: int | None
    """Shape of all fillets: 2 · (number of the size in `sizes_m`, counted from 0), plus 1 for the mirror image. Null:
    Roost uses all shapes in turn. Source: Fig. 1. Default: 2. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float]]
    """Length, width and thickness of each size. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04], [0.172,
    0.072, 0.032], [0.176, 0.072, 0.04]]."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. If you set this field, do not set `density_kg_m3`. The paper states both densities,
    but the two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤
    20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The centres of neighbouring sub-particles have the distance 2R. With half the radius,
    a body has eight times as many sub-particles. Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤
    0.05."""


class CompressProduct(TypedDict, total=False):
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""

    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. The value is null if you set
    `subparticle_density_kg_m3`. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    scale: float
    """Factor by which the lengths of bodies and sub-particles are multiplied. Source: Fig. 12. Default: 1.0. Range: ≥
    0.05 and ≤ 20."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. If you set this field, do not set `density_kg_m3`. The paper states both densities,
    but the two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤
    20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The centres of neighbouring sub-particles have the distance 2R. With half the radius,
    a body has eight times as many sub-particles. Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤
    0.05."""


class SceneProduct(TypedDict, total=False):
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""

    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. The value is null if you set
    `subparticle_density_kg_m3`. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["centres", "whole_spheres"]
    """Rule that decides which lattice points become sub-particles. `centres`: the points inside the shape.
    `whole_spheres`: the points whose whole sphere of radius R is inside the shape. Source: assumed. Default: "centres".
    """
    mesh: MeshFile | MeshDigest | None
    """A closed mesh (STL file) as the shape of all fillets. The mesh replaces the teardrop shapes of `sizes_m`. Source:
    section 2.2. Default: null."""
    scale: float
    """Factor by which the lengths of bodies and sub-particles are multiplied. Source: Fig. 12. Default: 1.0. Range: ≥
    0.05 and ≤ 20."""
    sizes_m: Sequence[Sequence[float]]
    """Length, width and thickness of each size. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04], [0.172,
    0.072, 0.032], [0.176, 0.072, 0.04]]."""
    spheres: bool
    """True: each body is one sphere of radius `subparticle_radius_m` and density `density_kg_m3`, without bonds. Use
    the value true for grains, and for comparisons with other programs. False: bodies have the shapes of `sizes_m` or
    `mesh`. Source: assumed. Default: false."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. If you set this field, do not set `density_kg_m3`. The paper states both densities,
    but the two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null. Range: ≥ 10 and ≤
    20000."""
    subparticle_radius_m: float
    """Radius R of a sub-particle. The centres of neighbouring sub-particles have the distance 2R. With half the radius,
    a body has eight times as many sub-particles. Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤
    0.05."""


class Drop(TypedDict, total=False):
    """Fillets hit plates. Each fillet has a plate of its own."""

    pitch_deg: float
    """Pitch: rotation about the fillet's width, after the yaw. At 90° the fillet falls tail first. Unit: °. Source:
    Fig. 10. Default: 0.0. Range: ≥ -180 and ≤ 180."""
    roll_deg: float
    """Roll: rotation about the fillet's length, after the pitch. At 90° the fillet falls on its side. Unit: °. Source:
    Fig. 10. Default: 0.0. Range: ≥ -180 and ≤ 180."""
    scatter_deg: float
    """Maximum random deviation of the yaw, pitch and roll of each fillet from `yaw_deg`, `pitch_deg` and `roll_deg`.
    The random numbers depend on `/seed`. Unit: °. Source: assumed. Default: 0.0. Range: ≥ 0 and ≤ 180."""
    speed_m_s: float
    """Downward speed of the fillets when they reach the plate. A free fall of 0.2 m gives 2 m/s. Unit: m/s. Source:
    Fig. 11. Default: 2.0. Range: ≥ 0 and ≤ 30."""
    yaw_deg: float
    """Yaw: rotation about the vertical axis. If yaw, pitch and roll are 0, the fillet lies flat with its length along
    x. Unit: °. Source: Fig. 10. Default: 0.0. Range: ≥ -180 and ≤ 180."""


class Bend(TypedDict, total=False):
    """A fillet bends under its own weight."""

    bar_radius_m: float
    """Radius of the bar, or of the roller at the conveyor's end. Unit: m. Source: assumed. Default: 0.02. Range: ≥
    0.002 and ≤ 1."""
    belt_speed_m_s: float
    """Speed of the conveyor, for `off_ledge`. Unit: m/s. Source: section 2.4. Default: 0.25. Range: ≥ 0 and ≤ 10."""
    clamped_share: float
    """Share of the fillet's length that the clamp holds, for `clamped`. Source: assumed. Default: 0.25. Range: > 0 and
    < 1."""
    scatter_deg: float
    """Maximum random deviation of the fillet's yaw. The random numbers depend on `/seed`. Unit: °. Source: assumed.
    Default: 0.0. Range: ≥ 0 and ≤ 45."""
    support: Literal["over_bar", "off_ledge", "clamped"]
    """Support of the fillet. `over_bar`: a bar, over which both ends hang. `off_ledge`: a conveyor, which carries the
    fillet over the conveyor's end. `clamped`: a clamp at the blunt end. Source: section 2.3.2. Default: "over_bar"."""


class Slide(TypedDict, total=False):
    """A fillet lies on a plate. The plate tilts until the fillet slides."""

    max_tilt_deg: float
    """Maximum tilt of the plate. Unit: °. Source: assumed. Default: 60.0. Range: ≥ 1 and ≤ 89."""
    scatter_deg: float
    """Maximum random deviation of the fillet's yaw. The random numbers depend on `/seed`. Unit: °. Source: assumed.
    Default: 0.0. Range: ≥ 0 and ≤ 180."""
    tilt_rate_deg_s: float
    """Angular speed at which the plate is tilted. Above 6 °/s, the error of the measured angle grows. Unit: °/s.
    Source: section 2.3.2. Default: 3.0. Range: ≥ 0.1 and ≤ 30."""
    yaw_deg: float
    """Direction of the fillet on the plate. At 0°, the length of the fillet points up the slope. Unit: °. Source:
    assumed. Default: 0.0. Range: ≥ -180 and ≤ 180."""


class Compress(TypedDict, total=False):
    """Two plates compress a block of tissue."""

    lattice: Sequence[int]
    """Numbers of sub-particles of the block along x, y and z. With a radius of 1.75 mm, a block of 10 × 10 × 3
    sub-particles measures 35 × 35 × 10.5 mm. Source: section 2.3.2. Default: [10, 10, 3]."""
    max_strain: float
    """Strain at which the test ends. The strain counts from the moment at which the stress becomes positive. Source:
    Fig. 6. Default: 0.06. Range: > 0 and ≤ 0.5."""
    modulus_from_strain: float
    """Start of the strain range to which the modulus is fitted. Source: section 3.1. Default: 0.0. Range: ≥ 0 and ≤
    0.5."""
    modulus_to_strain: float
    """End of the strain range to which the modulus is fitted. Source: section 3.1. Default: 0.03. Range: > 0 and ≤ 0.5.
    """
    plates: Literal["rough", "frictionless"]
    """Kind of the plates. `rough`: plates with the friction of the equipment. `frictionless`: plates without friction.
    Source: assumed. Default: "rough"."""
    strain_rate_1_s: float
    """Strain rate. The paper compresses a block of 10 mm height at 1 mm/min. This speed is a strain rate of 0.0017 1/s.
    Unit: 1/s. Source: assumed. Default: 0.05. Range: > 0 and ≤ 10."""


class Scene(TypedDict, total=False):
    """This section places bodies and surfaces."""

    bodies: Sequence[SceneBodiesItem]
    """This list has the bodies, with their shape, position, orientation and velocity."""
    gravity_direction: Sequence[float]
    """Direction of gravity, as a vector. The length of this vector has no effect, because `/numerics/gravity_m_s2` sets
    the acceleration. Source: assumed. Default: [0.0, 0.0, -1.0]."""
    margin_m: float
    """Distance from the bounding box of the scene at the start. A sub-particle that is farther outside this box leaves
    the simulation. Unit: m. Source: numerics. Default: 0.5. Range: > 0 and ≤ 10."""
    surfaces: Sequence[SceneSurfacesItem]
    """This list has the surfaces. The triangles of a surface move together."""


class HopperScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    contact: HopperContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    equipment: HopperEquipment
    """This section describes the hopper, the gate and the belt. The dimensions of Fig. 5 are derived from other numbers
    of the paper."""
    experiment: Required[Literal["hopper"]]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide`, `compress`: the
    paper's small tests (section 2.3). `scene`: bodies and surfaces that you place. Source: section 2."""
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: HopperNumerics
    """This section sets the time step, the duration, the sampling and the end of a simulation."""
    product: HopperProduct
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""
    schema: Literal["roost.scenario/2"]
    """Name and version of the document's format. Roost also reads the older format `roost.scenario/1`, in which bonds
    have no `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers. Another seed gives other random positions and angles. Source: numerics. Default: 1.
    Range: ≥ 0 and ≤ 9007199254740991."""


class DropScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    contact: DropContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    drop: Drop
    """Fillets hit plates. Each fillet has a plate of its own."""
    experiment: Required[Literal["drop"]]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide`, `compress`: the
    paper's small tests (section 2.3). `scene`: bodies and surfaces that you place. Source: section 2."""
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: DropNumerics
    """This section sets the time step, the duration, the sampling and the end of a simulation."""
    product: DropProduct
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""
    schema: Literal["roost.scenario/2"]
    """Name and version of the document's format. Roost also reads the older format `roost.scenario/1`, in which bonds
    have no `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers. Another seed gives other random positions and angles. Source: numerics. Default: 1.
    Range: ≥ 0 and ≤ 9007199254740991."""


class BendScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bend: Bend
    """A fillet bends under its own weight."""
    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    contact: BendContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    experiment: Required[Literal["bend"]]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide`, `compress`: the
    paper's small tests (section 2.3). `scene`: bodies and surfaces that you place. Source: section 2."""
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: BendNumerics
    """This section sets the time step, the duration, the sampling and the end of a simulation."""
    product: BendProduct
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""
    schema: Literal["roost.scenario/2"]
    """Name and version of the document's format. Roost also reads the older format `roost.scenario/1`, in which bonds
    have no `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers. Another seed gives other random positions and angles. Source: numerics. Default: 1.
    Range: ≥ 0 and ≤ 9007199254740991."""


class SlideScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    contact: SlideContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    experiment: Required[Literal["slide"]]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide`, `compress`: the
    paper's small tests (section 2.3). `scene`: bodies and surfaces that you place. Source: section 2."""
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: SlideNumerics
    """This section sets the time step, the duration, the sampling and the end of a simulation."""
    product: SlideProduct
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""
    schema: Literal["roost.scenario/2"]
    """Name and version of the document's format. Roost also reads the older format `roost.scenario/1`, in which bonds
    have no `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers. Another seed gives other random positions and angles. Source: numerics. Default: 1.
    Range: ≥ 0 and ≤ 9007199254740991."""
    slide: Slide
    """A fillet lies on a plate. The plate tilts until the fillet slides."""


class CompressScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    compress: Compress
    """Two plates compress a block of tissue."""
    contact: CompressContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    experiment: Required[Literal["compress"]]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide`, `compress`: the
    paper's small tests (section 2.3). `scene`: bodies and surfaces that you place. Source: section 2."""
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: CompressNumerics
    """This section sets the time step, the duration, the sampling and the end of a simulation."""
    product: CompressProduct
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""
    schema: Literal["roost.scenario/2"]
    """Name and version of the document's format. Roost also reads the older format `roost.scenario/1`, in which bonds
    have no `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers. Another seed gives other random positions and angles. Source: numerics. Default: 1.
    Range: ≥ 0 and ≤ 9007199254740991."""


class SceneScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    contact: SceneContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    experiment: Required[Literal["scene"]]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide`, `compress`: the
    paper's small tests (section 2.3). `scene`: bodies and surfaces that you place. Source: section 2."""
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: SceneNumerics
    """This section sets the time step, the duration, the sampling and the end of a simulation."""
    product: SceneProduct
    """This section describes the simulated bodies (fillets, a block or single spheres) and their sub-particles."""
    scene: Scene
    """This section places bodies and surfaces."""
    schema: Literal["roost.scenario/2"]
    """Name and version of the document's format. Roost also reads the older format `roost.scenario/1`, in which bonds
    have no `reference_radius_m`. Source: format. Default: "roost.scenario/2"."""
    seed: int
    """Seed of all random numbers. Another seed gives other random positions and angles. Source: numerics. Default: 1.
    Range: ≥ 0 and ≤ 9007199254740991."""


ScenarioDocument: TypeAlias = Union[HopperScenario, DropScenario, BendScenario, SlideScenario, CompressScenario, SceneScenario]
"""The scenario of any experiment."""
