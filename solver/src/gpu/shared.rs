//! Types shared by host and kernels: a Rust struct that writes its own WGSL declaration.

use bytemuck::{Pod, Zeroable};

/// A type that kernels also know.
pub trait Shared: Pod {
    /// Its name in WGSL.
    const NAME: &'static str;
    /// Its declaration in WGSL; empty for built-in types.
    fn declaration() -> String {
        String::new()
    }
    /// Its fields with their offsets in bytes; empty for built-in types.
    fn fields() -> Vec<(&'static str, usize)> {
        Vec::new()
    }
}

macro_rules! known {
    ($($Type:ty => $name:literal),* $(,)?) => { $(impl Shared for $Type { const NAME: &'static str = $name; })* };
}

known! { f32 => "f32", u32 => "u32", i32 => "i32", [f32; 3] => "vec3<f32>", [i32; 3] => "vec3<i32>", [u32; 3] => "vec3<u32>" }

/// A number updated by atomic operations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Atomic(pub u32);

impl Shared for Atomic {
    const NAME: &'static str = "atomic<u32>";
}

/// Declares Rust structs and lists them for the kernels.
macro_rules! shared {
    ($($(#[$doc:meta])* $Name:ident { $($(#[$field_doc:meta])* $field:ident: $Type:ty),* $(,)? })*) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
            #[repr(C)]
            pub struct $Name { $($(#[$field_doc])* pub $field: $Type),* }

            impl $crate::gpu::shared::Shared for $Name {
                const NAME: &'static str = stringify!($Name);
                fn declaration() -> String {
                    let fields = [$((stringify!($field), <$Type as $crate::gpu::shared::Shared>::NAME)),*];
                    let fields: String = fields.iter().map(|(field, name)| format!("    {field}: {name},\n")).collect();
                    format!("struct {} {{\n{fields}}}\n\n", Self::NAME)
                }
                fn fields() -> Vec<(&'static str, usize)> {
                    vec![$((stringify!($field), std::mem::offset_of!($Name, $field))),*]
                }
            }
        )*

        /// WGSL declarations of all shared types.
        pub fn declarations() -> String {
            [$($Name::declaration()),*].concat()
        }

        /// All shared types: name, size in bytes, fields with their offsets in bytes.
        pub fn all() -> Vec<(&'static str, usize, Vec<(&'static str, usize)>)> {
            vec![$(($Name::NAME, size_of::<$Name>(), $Name::fields())),*]
        }
    };
}

pub(super) use shared;
