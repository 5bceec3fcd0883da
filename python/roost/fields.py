"""Scenarios as types: the fields of each experiment with meaning, unit, default, range and source.

Generated: write it with `python3 python/generate.py`, and change the Rust types or the field table instead.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Literal, TypeAlias, TypedDict, Union

from roost.protocols import Array

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
    """This list has your own surfaces, such as parts from a CAD model. If `parametric` is true, Roost adds these
    surfaces to the surfaces that it makes itself. If `parametric` is false, the hopper has only the surfaces of this
    list. The fields are the same as in `/scene/surfaces` of the experiment `scene`."""

    kind: Literal["equipment", "belt", "frictionless"]
    """Kind of the surface, which selects its contact parameters. `equipment`: the parameters of
    `/contact/fillet_equipment`. `belt`: the parameters of `/contact/fillet_belt`. `frictionless`: as `equipment`, but
    without friction. Source: Table 2. Default: "equipment"."""
    mesh: MeshFile | MeshDigest | None
    """Triangles of the surface, from an STL file. Set either `mesh` or `plate_m`. The normal of a triangle is a
    direction at a right angle to the triangle. If the normals of a closed part point outwards, the part is solid. If
    fillets are inside a closed box, the normals of the box must point inwards. Source: assumed. Default: null."""
    motion: Literal["fixed", "belt", "moving"]
    """Motion of the surface from t = 0 on. `fixed`: no motion. `belt`: the surface stays in its place, but its material
    runs like a belt. `moving`: the whole surface moves and turns. Source: assumed. Default: "fixed"."""
    name: Required[str]
    """Name of the surface in messages and series. Two surfaces must not have the same name. Source: assumed."""
    orientation_deg: Sequence[float] | Array
    """Rotation of the surface about `position_m` by three angles: first yaw (about z), then pitch (about the turned y
    axis), then roll (about the turned x axis). Unit: °. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    pivot_m: Sequence[float] | Array
    """For the motion `moving`: position of the pivot at t = 0. The pivot is the point about which the surface turns.
    Unit: m. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    plate_m: Sequence[Sequence[float] | Array] | Array | None
    """Flat plate (parallelogram), instead of `mesh`: one corner, and two edges as vectors from this corner. Unit: m.
    Source: assumed. Default: null."""
    position_m: Sequence[float] | Array
    """Position of the surface. Roost moves the origin of the surface's triangles to this position. Unit: m. Source:
    assumed. Default: [0.0, 0.0, 0.0]."""
    presence: Literal["always", "until_start"]
    """Time during which the surface exists. `always`: during the whole simulation. `until_start`: only before t = 0,
    like a shutter. Source: assumed. Default: "always"."""
    spin_deg_s: Sequence[float] | Array
    """For the motion `moving`: angular velocity of the surface about the pivot, as a vector. Unit: °/s. Source:
    assumed. Default: [0.0, 0.0, 0.0]."""
    static_friction: float | None
    """Coulomb coefficient of friction of this surface. Null: the coefficient follows from `kind`. Source: assumed.
    Default: null. Range: ≥ 0 and ≤ 5."""
    velocity_m_s: Sequence[float] | Array
    """For the motion `belt`: velocity of the belt's material. For the motion `moving`: velocity of the pivot, which is
    the point about which the surface turns. Unit: m/s. Source: assumed. Default: [0.0, 0.0, 0.0]."""


class SceneBodiesItem(TypedDict, total=False):
    """This list has the bodies, with their shape, position, orientation and velocity."""

    orientation_deg: Sequence[float] | Array
    """Rotation of the body by three angles: first yaw (about z), then pitch (about the body's width), then roll (about
    the body's length). Unit: °. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    position_m: Required[Sequence[float] | Array]
    """Position of the body's centre of mass at the start. Unit: m. Source: assumed."""
    shape: int
    """Number of the body's shape. Shapes 0 and 1 belong to the first size in `/product/sizes_m`, shapes 2 and 3 to the
    second size, and so on. A shape with an odd number is a mirror image. Source: Fig. 1. Default: 0. Range: ≥ 0 and ≤
    63."""
    velocity_m_s: Sequence[float] | Array
    """Velocity of the body at the start. Unit: m/s. Source: assumed. Default: [0.0, 0.0, 0.0]."""


class SceneSurfacesItem(TypedDict, total=False):
    """This list has the surfaces, with their triangles, position, contact parameters and motion. The triangles of a
    surface move together."""

    kind: Literal["equipment", "belt", "frictionless"]
    """Kind of the surface, which selects its contact parameters. `equipment`: the parameters of
    `/contact/fillet_equipment`. `belt`: the parameters of `/contact/fillet_belt`. `frictionless`: as `equipment`, but
    without friction. Source: Table 2. Default: "equipment"."""
    mesh: MeshFile | MeshDigest | None
    """Triangles of the surface, from an STL file. Set either `mesh` or `plate_m`. The normal of a triangle is a
    direction at a right angle to the triangle. If the normals of a closed part point outwards, the part is solid. If
    fillets are inside a closed box, the normals of the box must point inwards. Source: assumed. Default: null."""
    motion: Literal["fixed", "belt", "moving"]
    """Motion of the surface from t = 0 on. `fixed`: no motion. `belt`: the surface stays in its place, but its material
    runs like a belt. `moving`: the whole surface moves and turns. Source: assumed. Default: "fixed"."""
    name: Required[str]
    """Name of the surface in messages and series. Two surfaces must not have the same name. Source: assumed."""
    orientation_deg: Sequence[float] | Array
    """Rotation of the surface about `position_m` by three angles: first yaw (about z), then pitch (about the turned y
    axis), then roll (about the turned x axis). Unit: °. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    pivot_m: Sequence[float] | Array
    """For the motion `moving`: position of the pivot at t = 0. The pivot is the point about which the surface turns.
    Unit: m. Source: assumed. Default: [0.0, 0.0, 0.0]."""
    plate_m: Sequence[Sequence[float] | Array] | Array | None
    """Flat plate (parallelogram), instead of `mesh`: one corner, and two edges as vectors from this corner. Unit: m.
    Source: assumed. Default: null."""
    position_m: Sequence[float] | Array
    """Position of the surface. Roost moves the origin of the surface's triangles to this position. Unit: m. Source:
    assumed. Default: [0.0, 0.0, 0.0]."""
    presence: Literal["always", "until_start"]
    """Time during which the surface exists. `always`: during the whole simulation. `until_start`: only before t = 0,
    like a shutter. Source: assumed. Default: "always"."""
    spin_deg_s: Sequence[float] | Array
    """For the motion `moving`: angular velocity of the surface about the pivot, as a vector. Unit: °/s. Source:
    assumed. Default: [0.0, 0.0, 0.0]."""
    static_friction: float | None
    """Coulomb coefficient of friction of this surface. Null: the coefficient follows from `kind`. Source: assumed.
    Default: null. Range: ≥ 0 and ≤ 5."""
    velocity_m_s: Sequence[float] | Array
    """For the motion `belt`: velocity of the belt's material. For the motion `moving`: velocity of the pivot, which is
    the point about which the surface turns. Unit: m/s. Source: assumed. Default: [0.0, 0.0, 0.0]."""


class ContactFilletBelt(TypedDict, total=False):
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""

    restitution: float
    """Coefficient of restitution on the belt. Default: that of /contact/fillet_fillet/restitution. Source: assumed.
    Range: > 0 and ≤ 1."""
    static_friction: float
    """Coulomb coefficient of friction on the belt. The paper did not measure this coefficient. The default for dry
    fillets is the value for a steel plate. The default for wet fillets is so low that the belt slips under the fillets,
    as section 3.4 reports. Default when wet: 0.2. Source: assumed. Default: 0.5. Range: ≥ 0 and ≤ 5."""
    surface_energy_j_m2: float
    """Surface energy γ between fillets and the belt. Unit: J/m². Default: that of
    /contact/fillet_fillet/surface_energy_j_m2. Source: assumed. Range: ≥ 0 and ≤ 10."""


class ContactFilletEquipment(TypedDict, total=False):
    """These values apply to contacts of sub-particles with walls, gates and plates."""

    restitution: float
    """Coefficient of restitution on walls, gates and plates. Default: that of /contact/fillet_fillet/restitution.
    Source: Table 2. Range: > 0 and ≤ 1."""
    static_friction: float
    """Coulomb coefficient of friction on walls, gates and plates. Dry and wet fillets have the same coefficient (Fig.
    8b). Source: Table 2. Default: 0.5. Range: ≥ 0 and ≤ 5."""
    surface_energy_j_m2: float
    """Surface energy γ between fillets and walls, gates or plates. Unit: J/m². Default: that of
    /contact/fillet_fillet/surface_energy_j_m2. Source: Table 2. Range: ≥ 0 and ≤ 10."""


class ContactFilletFillet(TypedDict, total=False):
    """These values apply to contacts between two sub-particles."""

    restitution: float
    """Coefficient of restitution between fillets: rebound speed divided by impact speed. Source: Table 2. Default:
    0.0001. Range: > 0 and ≤ 1."""
    static_friction: float
    """Coulomb coefficient of friction between fillets. Source: Table 2. Default: 0.1. Range: ≥ 0 and ≤ 5."""
    surface_energy_j_m2: float
    """Surface energy γ between fillets: half of the energy per area that is necessary to separate two fillets. The
    default for wet fillets is the surface tension of water at 20 °C (assumed). Unit: J/m². Default when wet: 0.0728.
    Source: Table 2. Default: 0.055. Range: ≥ 0 and ≤ 10."""


class HopperNumericsStop(TypedDict, total=False):
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""

    when_empty: bool
    """Whether the simulation ends when no body is left. In a hopper, every fillet has then passed the gate. In a scene,
    every body has then left the simulated space. Source: numerics. Default: true."""
    when_jammed_s: float | None
    """If nothing passes the gate for this time, the simulation ends. The simulation then ends even if little mass is
    left inside. Null: a jam does not end the simulation. Unit: s. Source: numerics. Default: null. Range: > 0 and ≤
    600."""


class DropNumericsStop(TypedDict, total=False):
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""

    when_done: bool
    """Whether the simulation ends as soon as its result is known. The result is known when the bodies are at rest
    (`drop`, `bend`, `scene`), when the fillet slides (`slide`), or when the strain reaches `max_strain` (`compress`).
    Source: numerics. Default: true."""


class BendNumericsStop(TypedDict, total=False):
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""

    when_done: bool
    """Whether the simulation ends as soon as its result is known. The result is known when the bodies are at rest
    (`drop`, `bend`, `scene`), when the fillet slides (`slide`), or when the strain reaches `max_strain` (`compress`).
    Source: numerics. Default: true."""


class SlideNumericsStop(TypedDict, total=False):
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""

    when_done: bool
    """Whether the simulation ends as soon as its result is known. The result is known when the bodies are at rest
    (`drop`, `bend`, `scene`), when the fillet slides (`slide`), or when the strain reaches `max_strain` (`compress`).
    Source: numerics. Default: true."""


class CompressNumericsStop(TypedDict, total=False):
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""

    when_done: bool
    """Whether the simulation ends as soon as its result is known. The result is known when the bodies are at rest
    (`drop`, `bend`, `scene`), when the fillet slides (`slide`), or when the strain reaches `max_strain` (`compress`).
    Source: numerics. Default: true."""


class SceneNumericsStop(TypedDict, total=False):
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""

    when_done: bool
    """Whether the simulation ends as soon as its result is known. The result is known when the bodies are at rest
    (`drop`, `bend`, `scene`), when the fillet slides (`slide`), or when the strain reaches `max_strain` (`compress`).
    Source: numerics. Default: false."""
    when_empty: bool
    """Whether the simulation ends when no body is left. In a hopper, every fillet has then passed the gate. In a scene,
    every body has then left the simulated space. Source: numerics. Default: true."""


class Bonds(TypedDict, total=False):
    """This section describes the bonds between the sub-particles of a body."""

    contact_between_bonded: bool
    """True: two sub-particles that a bond joins also have a contact force between them, in addition to the force of the
    bond. The commercial software of the paper's authors computes this contact force as well. False: only the bond acts
    between these two sub-particles. Source: assumed. Default: true."""
    contact_radius_ratio: float
    """Contact radius divided by the radius R of a sub-particle. The contact radius limits the length of a bond: a bond
    breaks when its length exceeds twice the contact radius. Source: Table 2. Default: 1.732. Range: > 1 and ≤ 1.732."""
    disk_scale: float
    """Radius R_b of the circular cross-section of a bond, divided by the radius R of a sub-particle. Source: assumed.
    Default: 1.0. Range: > 0 and ≤ 2."""
    formulation: Literal["corotated", "as_published", "finite_extension"]
    """Rule for the force of a bond. `corotated`: when the bond turns, the force turns with the bond. `as_published`:
    when the bond turns, the force keeps its direction. `finite_extension`: as `corotated`, but the bond also becomes
    stiffer before it breaks. Source: eq. 6. Default: "corotated"."""
    moment_stiffness_factor: float
    """Factor for the stiffness of a bond against bending and twisting. With the value 0, bonds resist neither bending
    nor twisting, as in the paper. With the value 1, the bending stiffness is S_n I, and the twisting stiffness is S_t
    J. Here, I and J are the second moments of area of the bond's cross-section: I for bending, J for twisting. The
    parallel bond of Potyondy and Cundall (2004) has the same stiffnesses. Source: assumed. Default: 0.0. Range: ≥ 0 and
    ≤ 10."""
    normal_stiffness_n_m3: float
    """Stiffness S_n of a bond along its length: force per change of length and per cross-section area of the bond.
    Unit: N/m³. Source: Table 2. Default: 1000000.0. Range: > 0 and ≤ 1000000000000."""
    normal_strength_pa: float | None
    """Stress along a bond at which the bond breaks. Null: no stress along the bond breaks the bond. Unit: Pa. Source:
    Table 2 has 1e300. Default: null. Range: > 0 and ≤ 1e+300."""
    reference_radius_m: float | None
    """Radius R_ref of the sub-particles for which S_n and S_t are given. At another radius R, Roost multiplies S_n and
    S_t by R_ref / R. The elastic modulus of the lattice then stays the same. Null: Roost uses S_n and S_t unchanged at
    every radius. Unit: m. Source: section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""
    shear_stiffness_n_m3: float
    """Stiffness S_t of a bond across its length (shear): force per sideways displacement and per cross-section area of
    the bond. Unit: N/m³. Source: Table 2. Default: 600000.0. Range: ≥ 0 and ≤ 1000000000000."""
    shear_strength_pa: float | None
    """Shear stress at which a bond breaks. Null: no shear stress breaks the bond. Unit: Pa. Source: Table 2 has 1e300.
    Default: null. Range: > 0 and ≤ 1e+300."""
    types: int
    """Number of types of sub-particles (Fig. 2). With 2 types, the types alternate on the lattice, and bonds join only
    sub-particles of different types. All bonds then lie along the edges of the lattice. With 1 type, bonds also lie
    along diagonals of the lattice. A diagonal has a bond if it is shorter than 2 R times `/bonds/contact_radius_ratio`.
    Source: section 2.2. Default: 2. Range: ≥ 1 and ≤ 2."""


class HopperContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets: dry or wet. The value `wet` changes two defaults: the surface energy between fillets, and
    the friction on the belt. By default, the surface energies on equipment and on the belt are the surface energy
    between fillets. If you set one of these fields yourself, Roost uses your value. Source: section 2.4. Default:
    "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between two sub-particles."""
    fillet_fillet_radius_ratio: float
    """Radius of a sub-particle in contacts with other fillets, divided by R. With the value 1, a sub-particle of one
    fillet can enter a gap between the sub-particles of another fillet. With the value 1.225, a sub-particle is too
    large to enter these gaps. Source: assumed. Default: 1.0. Range: ≥ 1 and ≤ 1.5."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, Roost uses the
    energy γ R/R₀. On equipment, the maximum adhesion force per area is then 3πγ/(4 R₀). This force per area does not
    depend on R. For a liquid film, the force per area is a property of the film, and also does not depend on R. Null:
    Roost uses γ unchanged at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class DropContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets: dry or wet. The value `wet` changes two defaults: the surface energy between fillets, and
    the friction on the belt. By default, the surface energies on equipment and on the belt are the surface energy
    between fillets. If you set one of these fields yourself, Roost uses your value. Source: section 2.4. Default:
    "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between two sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, Roost uses the
    energy γ R/R₀. On equipment, the maximum adhesion force per area is then 3πγ/(4 R₀). This force per area does not
    depend on R. For a liquid film, the force per area is a property of the film, and also does not depend on R. Null:
    Roost uses γ unchanged at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class BendContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets: dry or wet. The value `wet` changes two defaults: the surface energy between fillets, and
    the friction on the belt. By default, the surface energies on equipment and on the belt are the surface energy
    between fillets. If you set one of these fields yourself, Roost uses your value. Source: section 2.4. Default:
    "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between two sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, Roost uses the
    energy γ R/R₀. On equipment, the maximum adhesion force per area is then 3πγ/(4 R₀). This force per area does not
    depend on R. For a liquid film, the force per area is a property of the film, and also does not depend on R. Null:
    Roost uses γ unchanged at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class SlideContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets: dry or wet. The value `wet` changes two defaults: the surface energy between fillets, and
    the friction on the belt. By default, the surface energies on equipment and on the belt are the surface energy
    between fillets. If you set one of these fields yourself, Roost uses your value. Source: section 2.4. Default:
    "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between two sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, Roost uses the
    energy γ R/R₀. On equipment, the maximum adhesion force per area is then 3πγ/(4 R₀). This force per area does not
    depend on R. For a liquid film, the force per area is a property of the film, and also does not depend on R. Null:
    Roost uses γ unchanged at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class CompressContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets: dry or wet. The value `wet` changes two defaults: the surface energy between fillets, and
    the friction on the belt. By default, the surface energies on equipment and on the belt are the surface energy
    between fillets. If you set one of these fields yourself, Roost uses your value. Source: section 2.4. Default:
    "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between two sub-particles."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, Roost uses the
    energy γ R/R₀. On equipment, the maximum adhesion force per area is then 3πγ/(4 R₀). This force per area does not
    depend on R. For a liquid film, the force per area is a property of the film, and also does not depend on R. Null:
    Roost uses γ unchanged at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class SceneContact(TypedDict, total=False):
    """This section describes the contacts of sub-particles with each other and with the equipment."""

    condition: Literal["dry", "wet"]
    """Surface of the fillets: dry or wet. The value `wet` changes two defaults: the surface energy between fillets, and
    the friction on the belt. By default, the surface energies on equipment and on the belt are the surface energy
    between fillets. If you set one of these fields yourself, Roost uses your value. Source: section 2.4. Default:
    "dry"."""
    fillet_belt: ContactFilletBelt
    """These values apply to contacts of sub-particles with a belt. Not every experiment has a belt."""
    fillet_equipment: ContactFilletEquipment
    """These values apply to contacts of sub-particles with walls, gates and plates."""
    fillet_fillet: ContactFilletFillet
    """These values apply to contacts between two sub-particles."""
    fillet_fillet_radius_ratio: float
    """Radius of a sub-particle in contacts with other fillets, divided by R. With the value 1, a sub-particle of one
    fillet can enter a gap between the sub-particles of another fillet. With the value 1.225, a sub-particle is too
    large to enter these gaps. Source: assumed. Default: 1.0. Range: ≥ 1 and ≤ 1.5."""
    surface_energy_radius_m: float | None
    """Radius R₀ of the sub-particles for which the surface energies γ are given. At another radius R, Roost uses the
    energy γ R/R₀. On equipment, the maximum adhesion force per area is then 3πγ/(4 R₀). This force per area does not
    depend on R. For a liquid film, the force per area is a property of the film, and also does not depend on R. Null:
    Roost uses γ unchanged at every radius. Unit: m. Source: assumed. Default: null. Range: > 0 and ≤ 0.05."""


class HopperEquipment(TypedDict, total=False):
    """This section describes the hopper, the gate and the belt. The default width and length of the hopper (Fig. 5) are
    derived from other numbers of the paper."""

    belt_speed_m_s: float
    """Speed of the belt from t = 0 on. The paper's belt runs at 15 m/min (0.25 m/s). If `parametric` is false, the
    velocity of the belt in `surfaces` replaces this field. Unit: m/s. Source: section 2.4. Default: 0.25. Range: ≥ 0
    and ≤ 10."""
    feed_kg_s: float
    """Feed: mass per second of the fillets that enter from above after t = 0. These fillets start at the height
    `hopper_height_m`, at random positions where they touch nothing. With the value 0, there is no feed. Unit: kg/s.
    Source: assumed. Default: 0.0. Range: ≥ 0 and ≤ 1000."""
    gate_opening_m: float
    """Height of the gate's lower edge above the belt. If `parametric` is false, `gate_opening_m` has no effect: set
    `opening_height_m` instead. Roost then refuses a value of `gate_opening_m` that is neither the default nor equal to
    `opening_height_m`. Unit: m. Source: Fig. 5. Default: 0.06. Range: ≥ 0.001 and ≤ 5."""
    hopper_height_m: float
    """Height of the hopper walls above the belt. If `parametric` is true, this height is a minimum. Roost makes the
    walls higher if necessary: the walls end at least 0.1 m above the start positions of all fillets. Therefore fillets
    do not fall beside the hopper. Unit: m. Source: assumed. Default: 0.5. Range: ≥ 0.01 and ≤ 10."""
    hopper_length_m: float
    """Inner length of the hopper along the belt (along x), measured at the height of the belt. Unit: m. Source:
    derived. Default: 0.3. Range: ≥ 0.01 and ≤ 10."""
    hopper_width_m: float
    """Inner width of the hopper across the belt (along y). The default is derived from the paper's discharge of 33.2 kg
    in 4 s. Unit: m. Source: derived. Default: 0.59. Range: ≥ 0.01 and ≤ 10."""
    opening_height_m: float | None
    """Height of the gate's lower edge above the belt, if `parametric` is false. If this field is then null, Roost
    computes neither the belt capacity nor `regime`. If `parametric` is true, this field must be null. Unit: m. Source:
    assumed. Default: null. Range: ≥ 0.001 and ≤ 5."""
    opening_width_m: float | None
    """Inner width of the opening under the gate, if `parametric` is false. If this field is then null, Roost computes
    neither the belt capacity nor `regime`. If `parametric` is true, this field must be null. Unit: m. Source: assumed.
    Default: null. Range: ≥ 0.001 and ≤ 10."""
    parametric: bool
    """True: Roost makes the belt, the walls, the gate and the shutter from the fields of this table. False: the hopper
    consists only of the items of `surfaces`. Source: assumed. Default: true."""
    shutter_while_filling: bool
    """Whether a shutter closes the opening under the gate until the belt starts. Source: assumed. Default: true."""
    side_walls: Literal["rough", "frictionless", "periodic"]
    """Kind of the two walls along the belt. `rough`: walls with the friction of the equipment. `frictionless`: walls
    without friction, for a slice (narrow part) of a wide hopper. `periodic`: no walls. With `periodic`, a fillet that
    leaves on one side enters on the other side. Source: section 2.4. Default: "rough"."""
    surface_loads: bool
    """Whether the result has series of the force and the torque on each surface. Each surface adds six series to the
    result. Therefore the size of the result grows with the number of surfaces. Source: numerics. Default: false."""
    surfaces: Sequence[HopperEquipmentSurfacesItem]
    """This list has your own surfaces, such as parts from a CAD model. If `parametric` is true, Roost adds these
    surfaces to the surfaces that it makes itself. If `parametric` is false, the hopper has only the surfaces of this
    list. The fields are the same as in `/scene/surfaces` of the experiment `scene`."""
    wall_slope_deg: float
    """Angle between the vertical direction and the back wall (the wall at the end of the hopper opposite the gate). If
    the angle is above 0, the hopper widens upwards. Unit: °. Source: assumed. Default: 0.0. Range: ≥ 0 and ≤ 80."""


class Material(TypedDict, total=False):
    """This section has the elastic constants of the tissue."""

    poisson_ratio: float
    """Poisson's ratio of the tissue, which Roost uses for each sub-particle. Source: Table 2. Default: 0.37. Range: >
    -1 and < 0.5."""
    youngs_modulus_pa: float
    """Young's modulus of the tissue, which Roost uses for each sub-particle. With the default values, the stiffness of
    a whole fillet comes mostly from its bonds. Unit: Pa. Source: Table 2. Default: 48600.0. Range: ≥ 100 and ≤
    10000000000."""


class HopperNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. For this check, Roost computes the limit without
    damping. Use the value true only to study the stability. Source: numerics. Default: false."""
    duration_s: float
    """Maximum simulated time after t = 0. At t = 0, the belt or the test starts. Unit: s. Source: numerics. Default:
    6.0. Range: > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity. In `compress`, the default is 0, because the weight of the block would distort the curve
    of stress over strain. Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    jam_after_s: float
    """Minimum time of a stoppage that counts as a jam. A hopper has jammed when nothing passes the gate for this time,
    while at least 5 % of the filled mass is inside. If `when_jammed_s` is shorter than this time, Roost uses
    `when_jammed_s` instead. Unit: s. Source: numerics. Default: 1.0. Range: > 0 and ≤ 600."""
    max_fill_s: float
    """Maximum time for the fillets to come to rest. If the fillets are not at rest after this time, the simulation ends
    before t = 0. Unit: s. Source: numerics. Default: 10.0. Range: > 0 and ≤ 600."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """Speed limit for rest: the bodies are at rest when 99.9 % of the sub-particles are slower than this speed. In
    `hopper`, `bend` and `slide`, t = 0 is the moment at which the bodies have come to rest. The experiment `compress`
    does not use this field. Unit: m/s. Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """Maximum speed of a sub-particle. If a sub-particle is faster, the simulation ends with the end reason `unstable`.
    Unit: m/s. Source: numerics. Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: HopperNumericsStop
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""
    timestep_s: float | Literal["auto"]
    """Time step of the simulation. Above a certain time step, the stability limit, the simulation can become unstable
    (numerical errors grow without limit). `auto`: Roost computes a time step safely below this limit. The computation
    uses stiffness, mass, damping and the maximum speed of a body at the start. Unit: s. Source: Table 2. Default:
    5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class DropNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. For this check, Roost computes the limit without
    damping. Use the value true only to study the stability. Source: numerics. Default: false."""
    duration_s: float
    """Maximum simulated time after t = 0. At t = 0, the belt or the test starts. Unit: s. Source: numerics. Default:
    2.0. Range: > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity. In `compress`, the default is 0, because the weight of the block would distort the curve
    of stress over strain. Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.002. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """Speed limit for rest: the bodies are at rest when 99.9 % of the sub-particles are slower than this speed. In
    `hopper`, `bend` and `slide`, t = 0 is the moment at which the bodies have come to rest. The experiment `compress`
    does not use this field. Unit: m/s. Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """Maximum speed of a sub-particle. If a sub-particle is faster, the simulation ends with the end reason `unstable`.
    Unit: m/s. Source: numerics. Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: DropNumericsStop
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""
    timestep_s: float | Literal["auto"]
    """Time step of the simulation. Above a certain time step, the stability limit, the simulation can become unstable
    (numerical errors grow without limit). `auto`: Roost computes a time step safely below this limit. The computation
    uses stiffness, mass, damping and the maximum speed of a body at the start. Unit: s. Source: Table 2. Default:
    5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class BendNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. For this check, Roost computes the limit without
    damping. Use the value true only to study the stability. Source: numerics. Default: false."""
    duration_s: float
    """Maximum simulated time after t = 0. At t = 0, the belt or the test starts. Unit: s. Source: numerics. Default:
    5.0. Range: > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity. In `compress`, the default is 0, because the weight of the block would distort the curve
    of stress over strain. Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    max_fill_s: float
    """Maximum time for the fillets to come to rest. If the fillets are not at rest after this time, the simulation ends
    before t = 0. Unit: s. Source: numerics. Default: 10.0. Range: > 0 and ≤ 600."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """Speed limit for rest: the bodies are at rest when 99.9 % of the sub-particles are slower than this speed. In
    `hopper`, `bend` and `slide`, t = 0 is the moment at which the bodies have come to rest. The experiment `compress`
    does not use this field. Unit: m/s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """Maximum speed of a sub-particle. If a sub-particle is faster, the simulation ends with the end reason `unstable`.
    Unit: m/s. Source: numerics. Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: BendNumericsStop
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""
    timestep_s: float | Literal["auto"]
    """Time step of the simulation. Above a certain time step, the stability limit, the simulation can become unstable
    (numerical errors grow without limit). `auto`: Roost computes a time step safely below this limit. The computation
    uses stiffness, mass, damping and the maximum speed of a body at the start. Unit: s. Source: Table 2. Default:
    5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class SlideNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. For this check, Roost computes the limit without
    damping. Use the value true only to study the stability. Source: numerics. Default: false."""
    gravity_m_s2: float
    """Acceleration of gravity. In `compress`, the default is 0, because the weight of the block would distort the curve
    of stress over strain. Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    max_fill_s: float
    """Maximum time for the fillets to come to rest. If the fillets are not at rest after this time, the simulation ends
    before t = 0. Unit: s. Source: numerics. Default: 10.0. Range: > 0 and ≤ 600."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """Speed limit for rest: the bodies are at rest when 99.9 % of the sub-particles are slower than this speed. In
    `hopper`, `bend` and `slide`, t = 0 is the moment at which the bodies have come to rest. The experiment `compress`
    does not use this field. Unit: m/s. Source: numerics. Default: 0.01. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """Maximum speed of a sub-particle. If a sub-particle is faster, the simulation ends with the end reason `unstable`.
    Unit: m/s. Source: numerics. Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: SlideNumericsStop
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""
    timestep_s: float | Literal["auto"]
    """Time step of the simulation. Above a certain time step, the stability limit, the simulation can become unstable
    (numerical errors grow without limit). `auto`: Roost computes a time step safely below this limit. The computation
    uses stiffness, mass, damping and the maximum speed of a body at the start. Unit: s. Source: Table 2. Default:
    5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class CompressNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. For this check, Roost computes the limit without
    damping. Use the value true only to study the stability. Source: numerics. Default: false."""
    gravity_m_s2: float
    """Acceleration of gravity. In `compress`, the default is 0, because the weight of the block would distort the curve
    of stress over strain. Unit: m/s². Source: assumed. Default: 0.0. Range: ≥ 0 and ≤ 100."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """Speed limit for rest: the bodies are at rest when 99.9 % of the sub-particles are slower than this speed. In
    `hopper`, `bend` and `slide`, t = 0 is the moment at which the bodies have come to rest. The experiment `compress`
    does not use this field. Unit: m/s. Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """Maximum speed of a sub-particle. If a sub-particle is faster, the simulation ends with the end reason `unstable`.
    Unit: m/s. Source: numerics. Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: CompressNumericsStop
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""
    timestep_s: float | Literal["auto"]
    """Time step of the simulation. Above a certain time step, the stability limit, the simulation can become unstable
    (numerical errors grow without limit). `auto`: Roost computes a time step safely below this limit. The computation
    uses stiffness, mass, damping and the maximum speed of a body at the start. Unit: s. Source: Table 2. Default:
    5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class SceneNumerics(TypedDict, total=False):
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""

    allow_unstable: bool
    """Whether Roost accepts a time step above the stability limit. For this check, Roost computes the limit without
    damping. Use the value true only to study the stability. Source: numerics. Default: false."""
    duration_s: float
    """Maximum simulated time after t = 0. At t = 0, the belt or the test starts. Unit: s. Source: numerics. Default:
    2.0. Range: > 0 and ≤ 600."""
    gravity_m_s2: float
    """Acceleration of gravity. In `compress`, the default is 0, because the weight of the block would distort the curve
    of stress over strain. Unit: m/s². Source: assumed. Default: 9.81. Range: ≥ 0 and ≤ 100."""
    output_interval_s: float
    """Time between two samples of the series. Unit: s. Source: numerics. Default: 0.02. Range: > 0 and ≤ 0.1."""
    rest_speed_m_s: float
    """Speed limit for rest: the bodies are at rest when 99.9 % of the sub-particles are slower than this speed. In
    `hopper`, `bend` and `slide`, t = 0 is the moment at which the bodies have come to rest. The experiment `compress`
    does not use this field. Unit: m/s. Source: numerics. Default: 0.05. Range: > 0 and ≤ 1."""
    speed_limit_m_s: float
    """Maximum speed of a sub-particle. If a sub-particle is faster, the simulation ends with the end reason `unstable`.
    Unit: m/s. Source: numerics. Default: 30.0. Range: ≥ 1 and ≤ 10000."""
    stop: SceneNumericsStop
    """Each field is a condition. The simulation ends as soon as one of the conditions is met, at the latest after its
    duration."""
    timestep_s: float | Literal["auto"]
    """Time step of the simulation. Above a certain time step, the stability limit, the simulation can become unstable
    (numerical errors grow without limit). `auto`: Roost computes a time step safely below this limit. The computation
    uses stiffness, mass, damping and the maximum speed of a body at the start. Unit: s. Source: Table 2. Default:
    5.75e-05. Range: ≥ 1e-09 and ≤ 0.1."""


class HopperProduct(TypedDict, total=False):
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""

    count: int
    """Number of fillets. If `shape` is null, the fillets take all shapes in turn. By default, there are six shapes:
    three sizes, each with its mirror image. The fillets with the numbers 0, 6 and 12 then have shape 0. The paper's
    drop test has 15 fillets of each of six shapes (section 2.3.3). Source: section 2.4. Default: 191. Range: ≥ 1 and ≤
    100000."""
    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. If you set `subparticle_density_kg_m3`, this field
    is null. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["volume", "centres", "whole_spheres"]
    """Rule that selects the points of the lattice (cubic grid) at which a body has sub-particles. `volume`: each point
    has a cell, a cube with the edge 2R. Roost selects the cells with the largest share inside the shape, until the
    cells together have the volume of the shape. `centres`: all points inside the shape, as in the paper.
    `whole_spheres`: only the points whose whole sphere of radius R is inside the shape. With `centres` and
    `whole_spheres`, the volume of the cells depends on R. With `volume`, the lattice has fewer points at most: 5e4 for
    a mesh, and 1e6 for all shapes without a mesh. Source: assumed; the paper has the points inside. Default: "volume".
    """
    mesh: MeshFile | MeshDigest | None
    """Closed mesh (triangles from an STL file) that gives all fillets their shape. Null: the fillets are teardrops with
    the sizes in `sizes_m`. Source: section 2.2. Default: null."""
    scale: float
    """Factor for the size of the bodies. Roost multiplies the lengths of the bodies and the radius of the sub-particles
    by this factor. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    shape: int | None
    """Number of the shape of all fillets. Shapes 0 and 1 belong to the first size in `sizes_m`, shapes 2 and 3 to the
    second size, and so on. A shape with an odd number is a mirror image. Null: the fillets take all shapes in turn.
    Source: Fig. 1. Default: null. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float] | Array] | Array
    """Length, width and thickness of each size of fillet. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04],
    [0.172, 0.072, 0.032], [0.176, 0.072, 0.04]]."""
    spheres: bool
    """True: each body is a single sphere without bonds. The sphere has the radius `subparticle_radius_m` and the
    density `density_kg_m3`. Use the value true for grains, and for comparisons with other programs. False: bodies have
    the shapes of `sizes_m` or `mesh`. Source: assumed. Default: false."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. Set this field or `density_kg_m3`, but not both. The paper states a value for each of
    the two densities, but these two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null.
    Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius of a sub-particle before scaling. R is this radius times `scale`. The centres of neighbouring
    sub-particles are 2R apart. If you halve the radius, a body has eight times as many sub-particles. Unit: m. Source:
    section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class DropProduct(TypedDict, total=False):
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""

    count: int
    """Number of fillets. If `shape` is null, the fillets take all shapes in turn. By default, there are six shapes:
    three sizes, each with its mirror image. The fillets with the numbers 0, 6 and 12 then have shape 0. The paper's
    drop test has 15 fillets of each of six shapes (section 2.3.3). Source: section 2.4. Default: 90. Range: ≥ 1 and ≤
    100000."""
    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. If you set `subparticle_density_kg_m3`, this field
    is null. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["volume", "centres", "whole_spheres"]
    """Rule that selects the points of the lattice (cubic grid) at which a body has sub-particles. `volume`: each point
    has a cell, a cube with the edge 2R. Roost selects the cells with the largest share inside the shape, until the
    cells together have the volume of the shape. `centres`: all points inside the shape, as in the paper.
    `whole_spheres`: only the points whose whole sphere of radius R is inside the shape. With `centres` and
    `whole_spheres`, the volume of the cells depends on R. With `volume`, the lattice has fewer points at most: 5e4 for
    a mesh, and 1e6 for all shapes without a mesh. Source: assumed; the paper has the points inside. Default: "volume".
    """
    mesh: MeshFile | MeshDigest | None
    """Closed mesh (triangles from an STL file) that gives all fillets their shape. Null: the fillets are teardrops with
    the sizes in `sizes_m`. Source: section 2.2. Default: null."""
    scale: float
    """Factor for the size of the bodies. Roost multiplies the lengths of the bodies and the radius of the sub-particles
    by this factor. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    shape: int | None
    """Number of the shape of all fillets. Shapes 0 and 1 belong to the first size in `sizes_m`, shapes 2 and 3 to the
    second size, and so on. A shape with an odd number is a mirror image. Null: the fillets take all shapes in turn.
    Source: Fig. 1. Default: null. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float] | Array] | Array
    """Length, width and thickness of each size of fillet. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04],
    [0.172, 0.072, 0.032], [0.176, 0.072, 0.04]]."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. Set this field or `density_kg_m3`, but not both. The paper states a value for each of
    the two densities, but these two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null.
    Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius of a sub-particle before scaling. R is this radius times `scale`. The centres of neighbouring
    sub-particles are 2R apart. If you halve the radius, a body has eight times as many sub-particles. Unit: m. Source:
    section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class BendProduct(TypedDict, total=False):
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""

    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. If you set `subparticle_density_kg_m3`, this field
    is null. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["volume", "centres", "whole_spheres"]
    """Rule that selects the points of the lattice (cubic grid) at which a body has sub-particles. `volume`: each point
    has a cell, a cube with the edge 2R. Roost selects the cells with the largest share inside the shape, until the
    cells together have the volume of the shape. `centres`: all points inside the shape, as in the paper.
    `whole_spheres`: only the points whose whole sphere of radius R is inside the shape. With `centres` and
    `whole_spheres`, the volume of the cells depends on R. With `volume`, the lattice has fewer points at most: 5e4 for
    a mesh, and 1e6 for all shapes without a mesh. Source: assumed; the paper has the points inside. Default: "volume".
    """
    mesh: MeshFile | MeshDigest | None
    """Closed mesh (triangles from an STL file) that gives all fillets their shape. Null: the fillets are teardrops with
    the sizes in `sizes_m`. Source: section 2.2. Default: null."""
    scale: float
    """Factor for the size of the bodies. Roost multiplies the lengths of the bodies and the radius of the sub-particles
    by this factor. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    shape: int | None
    """Number of the shape of all fillets. Shapes 0 and 1 belong to the first size in `sizes_m`, shapes 2 and 3 to the
    second size, and so on. A shape with an odd number is a mirror image. Null: the fillets take all shapes in turn.
    Source: Fig. 1. Default: 2. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float] | Array] | Array
    """Length, width and thickness of each size of fillet. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04],
    [0.172, 0.072, 0.032], [0.176, 0.072, 0.04]]."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. Set this field or `density_kg_m3`, but not both. The paper states a value for each of
    the two densities, but these two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null.
    Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius of a sub-particle before scaling. R is this radius times `scale`. The centres of neighbouring
    sub-particles are 2R apart. If you halve the radius, a body has eight times as many sub-particles. Unit: m. Source:
    section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class SlideProduct(TypedDict, total=False):
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""

    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. If you set `subparticle_density_kg_m3`, this field
    is null. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["volume", "centres", "whole_spheres"]
    """Rule that selects the points of the lattice (cubic grid) at which a body has sub-particles. `volume`: each point
    has a cell, a cube with the edge 2R. Roost selects the cells with the largest share inside the shape, until the
    cells together have the volume of the shape. `centres`: all points inside the shape, as in the paper.
    `whole_spheres`: only the points whose whole sphere of radius R is inside the shape. With `centres` and
    `whole_spheres`, the volume of the cells depends on R. With `volume`, the lattice has fewer points at most: 5e4 for
    a mesh, and 1e6 for all shapes without a mesh. Source: assumed; the paper has the points inside. Default: "volume".
    """
    mesh: MeshFile | MeshDigest | None
    """Closed mesh (triangles from an STL file) that gives all fillets their shape. Null: the fillets are teardrops with
    the sizes in `sizes_m`. Source: section 2.2. Default: null."""
    scale: float
    """Factor for the size of the bodies. Roost multiplies the lengths of the bodies and the radius of the sub-particles
    by this factor. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    shape: int | None
    """Number of the shape of all fillets. Shapes 0 and 1 belong to the first size in `sizes_m`, shapes 2 and 3 to the
    second size, and so on. A shape with an odd number is a mirror image. Null: the fillets take all shapes in turn.
    Source: Fig. 1. Default: 2. Range: ≥ 0 and ≤ 63."""
    sizes_m: Sequence[Sequence[float] | Array] | Array
    """Length, width and thickness of each size of fillet. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04],
    [0.172, 0.072, 0.032], [0.176, 0.072, 0.04]]."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. Set this field or `density_kg_m3`, but not both. The paper states a value for each of
    the two densities, but these two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null.
    Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius of a sub-particle before scaling. R is this radius times `scale`. The centres of neighbouring
    sub-particles are 2R apart. If you halve the radius, a body has eight times as many sub-particles. Unit: m. Source:
    section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class CompressProduct(TypedDict, total=False):
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""

    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. If you set `subparticle_density_kg_m3`, this field
    is null. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    scale: float
    """Factor for the size of the bodies. Roost multiplies the lengths of the bodies and the radius of the sub-particles
    by this factor. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. Set this field or `density_kg_m3`, but not both. The paper states a value for each of
    the two densities, but these two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null.
    Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius of a sub-particle before scaling. R is this radius times `scale`. The centres of neighbouring
    sub-particles are 2R apart. If you halve the radius, a body has eight times as many sub-particles. Unit: m. Source:
    section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class SceneProduct(TypedDict, total=False):
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""

    density_kg_m3: float | None
    """Density of a body: the mass of the body divided by its volume. If you set `subparticle_density_kg_m3`, this field
    is null. Unit: kg/m³. Source: Table 2. Default: 940.0. Range: ≥ 10 and ≤ 20000."""
    fill: Literal["volume", "centres", "whole_spheres"]
    """Rule that selects the points of the lattice (cubic grid) at which a body has sub-particles. `volume`: each point
    has a cell, a cube with the edge 2R. Roost selects the cells with the largest share inside the shape, until the
    cells together have the volume of the shape. `centres`: all points inside the shape, as in the paper.
    `whole_spheres`: only the points whose whole sphere of radius R is inside the shape. With `centres` and
    `whole_spheres`, the volume of the cells depends on R. With `volume`, the lattice has fewer points at most: 5e4 for
    a mesh, and 1e6 for all shapes without a mesh. Source: assumed; the paper has the points inside. Default: "volume".
    """
    mesh: MeshFile | MeshDigest | None
    """Closed mesh (triangles from an STL file) that gives all fillets their shape. Null: the fillets are teardrops with
    the sizes in `sizes_m`. Source: section 2.2. Default: null."""
    scale: float
    """Factor for the size of the bodies. Roost multiplies the lengths of the bodies and the radius of the sub-particles
    by this factor. Source: Fig. 12. Default: 1.0. Range: ≥ 0.05 and ≤ 20."""
    sizes_m: Sequence[Sequence[float] | Array] | Array
    """Length, width and thickness of each size of fillet. Unit: m. Source: Table 1. Default: [[0.144, 0.072, 0.04],
    [0.172, 0.072, 0.032], [0.176, 0.072, 0.04]]."""
    spheres: bool
    """True: each body is a single sphere without bonds. The sphere has the radius `subparticle_radius_m` and the
    density `density_kg_m3`. Use the value true for grains, and for comparisons with other programs. False: bodies have
    the shapes of `sizes_m` or `mesh`. Source: assumed. Default: false."""
    subparticle_density_kg_m3: float | None
    """Density of a sub-particle. Set this field or `density_kg_m3`, but not both. The paper states a value for each of
    the two densities, but these two values contradict each other. Unit: kg/m³. Source: Table 2 has 2200. Default: null.
    Range: ≥ 10 and ≤ 20000."""
    subparticle_radius_m: float
    """Radius of a sub-particle before scaling. R is this radius times `scale`. The centres of neighbouring
    sub-particles are 2R apart. If you halve the radius, a body has eight times as many sub-particles. Unit: m. Source:
    section 2.2. Default: 0.004. Range: ≥ 0.0005 and ≤ 0.05."""


class Drop(TypedDict, total=False):
    """Fillets hit plates. Each fillet has a plate of its own."""

    pitch_deg: float
    """Pitch: rotation about the axis along the fillet's width. Roost applies the pitch after the yaw. At 90°, the
    fillet falls with its tail first. Unit: °. Source: Fig. 10. Default: 0.0. Range: ≥ -180 and ≤ 180."""
    roll_deg: float
    """Roll: rotation about the axis along the fillet's length. Roost applies the roll after the pitch. At 90°, the
    fillet falls on its side. Unit: °. Source: Fig. 10. Default: 0.0. Range: ≥ -180 and ≤ 180."""
    scatter_deg: float
    """Maximum random deviation of each fillet's yaw, pitch and roll from the angles `yaw_deg`, `pitch_deg` and
    `roll_deg`. The random numbers depend on `/seed`. Unit: °. Source: assumed. Default: 0.0. Range: ≥ 0 and ≤ 180."""
    speed_m_s: float
    """Downward speed of the fillets when they reach the plate. For example, a free fall of 0.2 m gives 2 m/s. Unit:
    m/s. Source: Fig. 11. Default: 2.0. Range: ≥ 0 and ≤ 30."""
    yaw_deg: float
    """Yaw: rotation about the vertical axis. If yaw, pitch and roll are 0, the fillet lies flat with its length along
    x. Unit: °. Source: Fig. 10. Default: 0.0. Range: ≥ -180 and ≤ 180."""


class Bend(TypedDict, total=False):
    """A fillet bends under its own weight."""

    bar_radius_m: float
    """Radius of the bar. For `off_ledge`: radius of the roller at the conveyor's end. Unit: m. Source: assumed.
    Default: 0.02. Range: ≥ 0.002 and ≤ 1."""
    belt_speed_m_s: float
    """Speed of the conveyor. Only the support `off_ledge` uses this field. Unit: m/s. Source: section 2.4. Default:
    0.25. Range: ≥ 0 and ≤ 10."""
    clamped_share: float
    """Share of the fillet's length that the clamp holds. Only the support `clamped` uses this field. Source: assumed.
    Default: 0.25. Range: > 0 and < 1."""
    scatter_deg: float
    """Maximum random deviation of the fillet's yaw, the rotation about the vertical axis. The random numbers depend on
    `/seed`. Unit: °. Source: assumed. Default: 0.0. Range: ≥ 0 and ≤ 45."""
    support: Literal["over_bar", "off_ledge", "clamped"]
    """Support of the fillet. `over_bar`: the fillet hangs over a bar. `off_ledge`: a conveyor carries the fillet over
    the conveyor's end. `clamped`: a clamp holds the blunt end of the fillet. Source: section 2.3.2. Default:
    "over_bar"."""


class Slide(TypedDict, total=False):
    """A fillet lies on a plate. The plate tilts until the fillet slides."""

    max_tilt_deg: float
    """Maximum tilt of the plate. At this tilt, the simulation ends. Unit: °. Source: assumed. Default: 60.0. Range: ≥ 1
    and ≤ 89."""
    scatter_deg: float
    """Maximum random deviation of the fillet's yaw from `yaw_deg`. The random numbers depend on `/seed`. Unit: °.
    Source: assumed. Default: 0.0. Range: ≥ 0 and ≤ 180."""
    tilt_rate_deg_s: float
    """Angular speed at which the plate tilts. Above 6 °/s, the error of the response `critical_angle_deg` grows. Unit:
    °/s. Source: section 2.3.2. Default: 3.0. Range: ≥ 0.1 and ≤ 30."""
    yaw_deg: float
    """Yaw of the fillet: its direction on the plate. At 0°, the fillet lies along the slope, with its tail (the narrow
    end) uphill. Unit: °. Source: assumed. Default: 0.0. Range: ≥ -180 and ≤ 180."""


class Compress(TypedDict, total=False):
    """Two plates compress a block of tissue."""

    lattice: Sequence[int] | Array
    """Numbers of sub-particles of the block along x, y and z (upwards). For example, with R = 1.75 mm, a block of 10 ×
    10 × 3 sub-particles measures 35 × 35 × 10.5 mm. Source: section 2.3.2. Default: [10, 10, 3]."""
    max_strain: float
    """Strain at which the test ends. The strain is 0 at the moment at which the stress becomes positive. Source: Fig.
    6. Default: 0.06. Range: > 0 and ≤ 0.5."""
    modulus_from_strain: float
    """Lower end of the strain range in which Roost determines the modulus. Source: section 3.1. Default: 0.0. Range: ≥
    0 and ≤ 0.5."""
    modulus_to_strain: float
    """Upper end of the strain range in which Roost determines the modulus. Source: section 3.1. Default: 0.03. Range: >
    0 and ≤ 0.5."""
    plates: Literal["rough", "frictionless"]
    """Kind of the plates. `rough`: plates with the friction of the equipment. `frictionless`: plates without friction.
    Source: assumed. Default: "rough"."""
    strain_rate_1_s: float
    """Strain rate: change of the strain per second. The paper compresses a block of 10 mm height at 1 mm/min. This
    speed is a strain rate of 0.0017 1/s. Unit: 1/s. Source: assumed. Default: 0.05. Range: > 0 and ≤ 10."""


class Scene(TypedDict, total=False):
    """This section places bodies and surfaces."""

    bodies: Sequence[SceneBodiesItem]
    """This list has the bodies, with their shape, position, orientation and velocity."""
    gravity_direction: Sequence[float] | Array
    """Direction of gravity, as a vector. The length of the vector has no effect, because `/numerics/gravity_m_s2` sets
    the acceleration. Source: assumed. Default: [0.0, 0.0, -1.0]."""
    margin_m: float
    """Margin around the scene. The simulated space is the bounding box of the scene at the start, enlarged on all sides
    by this margin. A sub-particle that goes out of the simulated space leaves the simulation. Unit: m. Source:
    numerics. Default: 0.5. Range: > 0 and ≤ 10."""
    surfaces: Sequence[SceneSurfacesItem]
    """This list has the surfaces, with their triangles, position, contact parameters and motion. The triangles of a
    surface move together."""


class HopperScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    contact: HopperContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    equipment: HopperEquipment
    """This section describes the hopper, the gate and the belt. The default width and length of the hopper (Fig. 5) are
    derived from other numbers of the paper."""
    experiment: Required[Literal["hopper"]]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide` and `compress`:
    the paper's small tests (section 2.3). `scene`: bodies and surfaces at positions that you choose. Source: section 2.
    """
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: HopperNumerics
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""
    product: HopperProduct
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""
    schema: Literal["roost.scenario/3"]
    """Name and version of the document's format. Roost also reads the older formats `roost.scenario/1` and
    `roost.scenario/2`. In both, the default of `/product/fill` is `centres`. In `roost.scenario/1`, bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/3"."""
    seed: int
    """Start value of all random numbers. With another seed, the random start positions and angles of the bodies are
    different. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""


class DropScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    contact: DropContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    drop: Drop
    """Fillets hit plates. Each fillet has a plate of its own."""
    experiment: Required[Literal["drop"]]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide` and `compress`:
    the paper's small tests (section 2.3). `scene`: bodies and surfaces at positions that you choose. Source: section 2.
    """
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: DropNumerics
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""
    product: DropProduct
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""
    schema: Literal["roost.scenario/3"]
    """Name and version of the document's format. Roost also reads the older formats `roost.scenario/1` and
    `roost.scenario/2`. In both, the default of `/product/fill` is `centres`. In `roost.scenario/1`, bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/3"."""
    seed: int
    """Start value of all random numbers. With another seed, the random start positions and angles of the bodies are
    different. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""


class BendScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bend: Bend
    """A fillet bends under its own weight."""
    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    contact: BendContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    experiment: Required[Literal["bend"]]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide` and `compress`:
    the paper's small tests (section 2.3). `scene`: bodies and surfaces at positions that you choose. Source: section 2.
    """
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: BendNumerics
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""
    product: BendProduct
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""
    schema: Literal["roost.scenario/3"]
    """Name and version of the document's format. Roost also reads the older formats `roost.scenario/1` and
    `roost.scenario/2`. In both, the default of `/product/fill` is `centres`. In `roost.scenario/1`, bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/3"."""
    seed: int
    """Start value of all random numbers. With another seed, the random start positions and angles of the bodies are
    different. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""


class SlideScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    contact: SlideContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    experiment: Required[Literal["slide"]]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide` and `compress`:
    the paper's small tests (section 2.3). `scene`: bodies and surfaces at positions that you choose. Source: section 2.
    """
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: SlideNumerics
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""
    product: SlideProduct
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""
    schema: Literal["roost.scenario/3"]
    """Name and version of the document's format. Roost also reads the older formats `roost.scenario/1` and
    `roost.scenario/2`. In both, the default of `/product/fill` is `centres`. In `roost.scenario/1`, bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/3"."""
    seed: int
    """Start value of all random numbers. With another seed, the random start positions and angles of the bodies are
    different. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""
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
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide` and `compress`:
    the paper's small tests (section 2.3). `scene`: bodies and surfaces at positions that you choose. Source: section 2.
    """
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: CompressNumerics
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""
    product: CompressProduct
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""
    schema: Literal["roost.scenario/3"]
    """Name and version of the document's format. Roost also reads the older formats `roost.scenario/1` and
    `roost.scenario/2`. In both, the default of `/product/fill` is `centres`. In `roost.scenario/1`, bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/3"."""
    seed: int
    """Start value of all random numbers. With another seed, the random start positions and angles of the bodies are
    different. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""


class SceneScenario(TypedDict, total=False):
    """The complete input of one simulation, in SI units; t = 0 is belt start."""

    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    contact: SceneContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    experiment: Required[Literal["scene"]]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide` and `compress`:
    the paper's small tests (section 2.3). `scene`: bodies and surfaces at positions that you choose. Source: section 2.
    """
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: SceneNumerics
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""
    product: SceneProduct
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""
    scene: Scene
    """This section places bodies and surfaces."""
    schema: Literal["roost.scenario/3"]
    """Name and version of the document's format. Roost also reads the older formats `roost.scenario/1` and
    `roost.scenario/2`. In both, the default of `/product/fill` is `centres`. In `roost.scenario/1`, bonds have no
    `reference_radius_m`. Source: format. Default: "roost.scenario/3"."""
    seed: int
    """Start value of all random numbers. With another seed, the random start positions and angles of the bodies are
    different. Source: numerics. Default: 1. Range: ≥ 0 and ≤ 9007199254740991."""


ScenarioDocument: TypeAlias = Union[HopperScenario, DropScenario, BendScenario, SlideScenario, CompressScenario, SceneScenario]
"""The scenario of any experiment."""


class ScenarioChanges(TypedDict, total=False):
    """New values of fields and sections."""

    bend: Bend
    """A fillet bends under its own weight. Only in `bend`."""
    bonds: Bonds
    """This section describes the bonds between the sub-particles of a body."""
    compress: Compress
    """Two plates compress a block of tissue. Only in `compress`."""
    contact: HopperContact | DropContact | BendContact | SlideContact | CompressContact | SceneContact
    """This section describes the contacts of sub-particles with each other and with the equipment."""
    drop: Drop
    """Fillets hit plates. Each fillet has a plate of its own. Only in `drop`."""
    equipment: HopperEquipment
    """This section describes the hopper, the gate and the belt. The default width and length of the hopper (Fig. 5) are
    derived from other numbers of the paper. Only in `hopper`."""
    experiment: Literal["hopper", "drop", "bend", "slide", "compress", "scene"]
    """Kind of simulation. `hopper`: the discharge of a hopper (section 2.4). `drop`, `bend`, `slide` and `compress`:
    the paper's small tests (section 2.3). `scene`: bodies and surfaces at positions that you choose. Source: section 2.
    """
    material: Material
    """This section has the elastic constants of the tissue."""
    numerics: HopperNumerics | DropNumerics | BendNumerics | SlideNumerics | CompressNumerics | SceneNumerics
    """This section sets the time step, the duration, the time between samples, and the end of a simulation."""
    product: HopperProduct | DropProduct | BendProduct | SlideProduct | CompressProduct | SceneProduct
    """This section describes the bodies and their sub-particles. A body is a fillet, a block of tissue (only in
    `compress`) or a single sphere."""
    scene: Scene
    """This section places bodies and surfaces. Only in `scene`."""
    schema: Literal["roost.scenario/3"]
    """Name and version of the document's format. Roost also reads the older formats `roost.scenario/1` and
    `roost.scenario/2`. In both, the default of `/product/fill` is `centres`. In `roost.scenario/1`, bonds have no
    `reference_radius_m`. Source: format."""
    seed: int
    """Start value of all random numbers. With another seed, the random start positions and angles of the bodies are
    different. Source: numerics."""
    slide: Slide
    """A fillet lies on a plate. The plate tilts until the fillet slides. Only in `slide`."""
