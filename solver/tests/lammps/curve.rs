//! Reads the tables that LAMMPS has written, and says how far a curve lies from one of them.
#![allow(unreachable_pub, reason = "a module of one test")]

use std::path::Path;

/// A table of numbers with named columns.
pub struct Table {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Table {
    /// The file of that name beside this one.
    pub fn read(name: &str) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/lammps").join(name);
        let text =
            std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Self::parse(&text)
    }

    /// A line of names, then lines of as many numbers.
    pub fn parse(text: &str) -> Self {
        let mut lines = text.lines().map(|line| line.split(','));
        let names: Vec<String> = lines.next().expect("a line of names").map(String::from).collect();
        let number = |cell: &str| cell.parse().unwrap_or_else(|_| panic!("{cell:?} is not a number"));
        let rows: Vec<Vec<f64>> = lines.map(|line| line.map(number).collect()).collect();
        assert!(rows.iter().all(|row| row.len() == names.len()), "every row has {} cells", names.len());
        Self { names, rows }
    }

    /// The numbers of a column.
    pub fn column(&self, name: &str) -> Vec<f64> {
        let found = self.names.iter().position(|known| known == name);
        let k = found.unwrap_or_else(|| panic!("no column {name} among {:?}", self.names));
        self.rows.iter().map(|row| row[k]).collect()
    }
}

/// A curve: x, ascending, and y.
pub type Curve = Vec<(f64, f64)>;

/// Joins two columns.
pub fn joined(x: &[f64], y: &[f64]) -> Curve {
    x.iter().copied().zip(y.iter().copied()).collect()
}

/// y at x, on the straight line between two points; `None` beyond the ends.
fn at(curve: &[(f64, f64)], x: f64) -> Option<f64> {
    let after = curve.partition_point(|point| point.0 < x);
    let &(x1, y1) = curve.get(after)?;
    if x1 == x {
        return Some(y1);
    }
    let &(x0, y0) = curve.get(after.checked_sub(1)?)?;
    Some(y0 + (y1 - y0) * (x - x0) / (x1 - x0))
}

/// The greatest difference along y between the points of `reference` and the curve `found`, in per cent of `scale`.
/// Of a hundred points of the reference one may lie beyond the ends of what was found, and is left out.
pub fn difference_percent(reference: &[(f64, f64)], found: &[(f64, f64)], scale: f64) -> f64 {
    assert!(found.is_sorted_by(|a, b| a.0 <= b.0), "x ascends");
    let (mut greatest, mut seen) = (0.0f64, 0);
    for &(x, expected) in reference {
        let Some(y) = at(found, x) else { continue };
        assert!(y.is_finite(), "{y} at {x:e}");
        greatest = greatest.max((y - expected).abs());
        seen += 1;
    }
    assert!(seen * 100 >= reference.len() * 99, "{seen} of {} points were visited", reference.len());
    100.0 * greatest / scale
}

/// Asserts that a curve lies within so many per cent of `scale` from the reference.
#[track_caller]
pub fn assert_agrees(what: &str, reference: &[(f64, f64)], found: &[(f64, f64)], scale: f64, percent: f64) {
    let seen = difference_percent(reference, found, scale);
    println!("{what}: {seen:.3} %");
    assert!(seen <= percent, "{what}: {seen:.3} % of the scale away from LAMMPS, {percent} % are allowed");
}

/// The same for two numbers.
#[track_caller]
pub fn assert_number_agrees(what: &str, reference: f64, found: f64, percent: f64) {
    let seen = 100.0 * (found / reference - 1.0).abs();
    println!("{what}: {seen:.3} %");
    assert!(seen <= percent, "{what}: {found:e} is {seen:.3} % away from LAMMPS' {reference:e}");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parabola(factor: f64, upto: u32) -> Curve {
        (0..=upto).map(|k| f64::from(k) / 100.0).map(|x| (x, factor * x * x)).collect()
    }

    #[test]
    fn difference_of_two_curves_is_a_percentage_of_the_scale() {
        let seen = difference_percent(&parabola(1.0, 100), &parabola(1.02, 100), 1.0);
        assert!((seen - 2.0).abs() < 1e-9, "{seen}");
        let one_spike: Curve =
            parabola(1.0, 100).iter().map(|&(x, y)| (x, y + f64::from(x == 0.37))).collect();
        let seen = difference_percent(&parabola(1.0, 100), &one_spike, 1.0);
        assert!((seen - 100.0).abs() < 1e-9, "{seen}");
        assert_eq!(at(&[(0.0, 0.0), (2.0, 4.0)], 0.5), Some(1.0));
        assert_eq!(at(&[(0.0, 0.0), (2.0, 4.0)], 2.5), None);
    }

    #[test]
    #[should_panic(expected = "2.000 % of the scale away")]
    fn curve_with_2_percent_difference_fails_a_1_percent_tolerance() {
        assert_agrees("parabola", &parabola(1.0, 100), &parabola(0.98, 100), 1.0, 1.0);
    }

    #[test]
    #[should_panic(expected = "51 of 101 points")]
    fn curve_of_half_the_range_fails() {
        assert_agrees("parabola", &parabola(1.0, 100), &parabola(1.0, 50), 1.0, 1.0);
    }

    #[test]
    #[should_panic(expected = "NaN at")]
    fn curve_with_nan_fails() {
        assert_agrees("parabola", &parabola(1.0, 100), &parabola(f64::NAN, 100), 1.0, 1.0);
    }

    #[test]
    #[should_panic(expected = "% away from LAMMPS")]
    fn number_with_2_percent_difference_fails_a_1_percent_tolerance() {
        assert_number_agrees("speed", 0.25, 0.255, 1.0);
    }

    #[test]
    #[should_panic(expected = "no column force_n")]
    fn a_missing_column_is_refused() {
        Table::parse("overlap_m,normal_n\n1e-5,2e-3").column("force_n");
    }

    #[test]
    #[should_panic(expected = "is not a number")]
    fn text_in_a_number_column_is_refused() {
        Table::parse("overlap_m,normal_n\n1e-5,none");
    }
}
