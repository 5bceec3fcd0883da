//! The instruction sets that a kernel can run with on this machine.

use pulp::Arch;

/// An instruction set that this machine has.
#[derive(Clone, Copy, Debug)]
pub struct Instructions {
    pub(super) arch: Arch,
    name: &'static str,
}

impl Instructions {
    /// All that this machine has, the widest first. The last, without vectors, runs anywhere.
    pub fn available() -> Vec<Self> {
        let mut all = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            use pulp::x86::{V3, V4};
            all.extend(V4::try_new().map(|simd| Self { arch: Arch::V4(simd), name: "AVX-512" }));
            all.extend(V3::try_new().map(|simd| Self { arch: Arch::V3(simd), name: "AVX2" }));
        }
        #[cfg(target_arch = "aarch64")]
        if !matches!(Arch::new(), Arch::Scalar) {
            all.push(Self { arch: Arch::new(), name: "Neon" });
        }
        all.push(Self { arch: Arch::Scalar, name: "scalar" });
        all
    }

    /// The widest that this machine has.
    pub fn widest() -> Self {
        Self::available()[0]
    }

    /// Its name, such as `AVX-512`.
    pub fn name(&self) -> &'static str {
        self.name
    }
}
