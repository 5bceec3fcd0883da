//! Designs: which combinations of levels make the points.

use roost_api::sweep::Design;

/// How many points a design has for factors with so many levels; `None` past 2⁶⁴.
pub(super) fn size(design: &Design, levels: &[usize]) -> Option<u64> {
    match design {
        Design::Grid {} => levels.iter().try_fold(1_u64, |product, count| product.checked_mul(*count as u64)),
    }
}

/// The index of each factor's level at design point `index`.
pub(super) fn level_indices(design: &Design, levels: &[usize], index: u64) -> Vec<usize> {
    match design {
        Design::Grid {} => grid(levels, index),
    }
}

/// Mixed-radix digits of the index, the last factor varying fastest.
fn grid(levels: &[usize], mut index: u64) -> Vec<usize> {
    let mut digits = vec![0; levels.len()];
    for (digit, count) in digits.iter_mut().zip(levels).rev() {
        *digit = (index % *count as u64) as usize;
        index /= *count as u64;
    }
    digits
}
