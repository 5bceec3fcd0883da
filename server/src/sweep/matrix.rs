//! The design matrix: which values make the points, and in which order.
//!
//! Points of drawn designs depend on the seed and their index alone, so that a longer sequence begins with the shorter one.

use serde_json::Value;

use super::draw;
use super::plan::{Input, Plan, Points};
use super::values::Values;

/// A design point: a value a factor, none where it stays as in the base.
pub(super) type Row = Vec<Option<Value>>;

/// How many points a plan has; `None` past 2⁶⁴.
pub(super) fn size(plan: &Plan) -> Option<u64> {
    match &plan.points {
        Points::Grid => grid_size(&counts(&plan.factors)),
        Points::OneAtATime => Some(1 + counts(&plan.factors).iter().map(|count| *count as u64).sum::<u64>()),
        Points::Random { points, .. }
        | Points::LatinHypercube { points, .. }
        | Points::Sobol { points, .. } => Some(u64::from(*points)),
        Points::BoxBehnken => Some(edges(plan.factors.len()).len() as u64 + 1),
        Points::Rows(rows) => Some(rows.len() as u64),
    }
}

/// How many points of a plan by levels hold a new one, of each factor so many levels being old; `None` past 2⁶⁴.
pub(super) fn added(plan: &Plan, old: &[usize]) -> Option<u64> {
    match &plan.points {
        Points::Grid => grid_size(&counts(&plan.factors))?.checked_sub(grid_size(old)?),
        Points::OneAtATime => Some(size(plan)? - 1 - old.iter().map(|count| *count as u64).sum::<u64>()),
        _ => Some(0),
    }
}

/// All points of a plan, of a size that was looked at before.
pub(super) fn rows(plan: &Plan) -> Vec<Row> {
    match &plan.points {
        Points::Grid => grid(&plan.factors, &vec![0; plan.factors.len()]),
        Points::OneAtATime => {
            let mut rows = vec![vec![None; plan.factors.len()]];
            rows.extend(one_at_a_time(&plan.factors, &vec![0; plan.factors.len()]));
            rows
        }
        Points::Random { points, seed } => random(&plan.factors, 0..*points, *seed),
        Points::Sobol { points, seed } => sobol(&plan.factors, 0..*points, *seed),
        Points::LatinHypercube { points, seed } => {
            let columns: Vec<Vec<f64>> = (0..plan.factors.len())
                .map(|factor| draw::latin_hypercube(*points as usize, factor, *seed))
                .collect();
            (0..*points as usize).map(|point| drawn(&plan.factors, |factor| columns[factor][point])).collect()
        }
        Points::BoxBehnken => {
            let centre = vec![0; plan.factors.len()];
            let signs = edges(plan.factors.len()).into_iter().chain([centre]);
            let level = |(input, sign): (&Input, &i8)| Some(levels(input)[(sign + 1) as usize].clone());
            signs.map(|signs| plan.factors.iter().zip(&signs).map(level).collect()).collect()
        }
        Points::Rows(rows) => rows.iter().map(|row| row.iter().cloned().map(Some).collect()).collect(),
    }
}

/// Points of a random design by index.
pub(super) fn random(factors: &[Input], points: std::ops::Range<u32>, seed: u64) -> Vec<Row> {
    points
        .map(|point| {
            let mut units = draw::random(point, seed);
            drawn(factors, |_| units.next().unwrap_or_default())
        })
        .collect()
}

/// Points of a Sobol sequence by index.
pub(super) fn sobol(factors: &[Input], points: std::ops::Range<u32>, seed: u64) -> Vec<Row> {
    points.map(|point| drawn(factors, |factor| draw::sobol(point, factor, seed))).collect()
}

fn drawn(factors: &[Input], mut unit: impl FnMut(usize) -> f64) -> Row {
    factors.iter().enumerate().map(|(index, input)| Some(input.values.drawn(unit(index)))).collect()
}

fn counts(factors: &[Input]) -> Vec<usize> {
    factors.iter().map(|input| levels(input).len()).collect()
}

/// The levels of a factor in a design that goes by levels.
fn levels(input: &Input) -> &[Value] {
    match &input.values {
        Values::Levels(levels) => levels,
        Values::Between { .. } | Values::Listed => &[],
    }
}

fn grid_size(counts: &[usize]) -> Option<u64> {
    counts.iter().try_fold(1_u64, |product, count| product.checked_mul(*count as u64))
}

/// Every combination of levels that holds a new one, the last factor varying fastest; of each factor so many levels are old. A
/// grid without old levels is all new.
pub(super) fn grid(factors: &[Input], old: &[usize]) -> Vec<Row> {
    let counts = counts(factors);
    let is_new = |digits: &[usize]| digits.iter().zip(old).any(|(digit, old)| digit >= old);
    (0..grid_size(&counts).unwrap_or(0))
        .map(|index| digits(&counts, index))
        .filter(|digits| digits.is_empty() || is_new(digits))
        .map(|digits| {
            factors.iter().zip(digits).map(|(input, level)| Some(levels(input)[level].clone())).collect()
        })
        .collect()
}

/// Mixed-radix digits of the index, the last varying fastest.
pub(super) fn digits(counts: &[usize], mut index: u64) -> Vec<usize> {
    let mut digits = vec![0; counts.len()];
    for (digit, count) in digits.iter_mut().zip(counts).rev() {
        *digit = (index % *count as u64) as usize;
        index /= *count as u64;
    }
    digits
}

/// Each factor in turn through its levels after the old ones, all others as in the base.
pub(super) fn one_at_a_time(factors: &[Input], old: &[usize]) -> Vec<Row> {
    let mut rows = Vec::new();
    for (index, (input, old)) in factors.iter().zip(old).enumerate() {
        for level in &levels(input)[*old..] {
            let mut row = vec![None; factors.len()];
            row[index] = Some(level.clone());
            rows.push(row);
        }
    }
    rows
}

/// The factors that vary together in the designs of 3 to 7 factors, block by block (Box and Behnken 1960, Technometrics
/// 2(4), 455–475): pairs up to five factors, threes of six and seven.
const BLOCKS: [&[&[usize]]; 5] = [
    &[&[0, 1], &[0, 2], &[1, 2]],
    &[&[0, 1], &[2, 3], &[0, 3], &[1, 2], &[0, 2], &[1, 3]],
    &[&[0, 1], &[2, 3], &[1, 4], &[0, 2], &[3, 4], &[1, 2], &[0, 3], &[2, 4], &[0, 4], &[1, 3]],
    &[&[0, 1, 3], &[1, 2, 4], &[2, 3, 5], &[0, 3, 4], &[1, 4, 5], &[0, 2, 5]],
    &[&[3, 4, 5], &[0, 5, 6], &[1, 4, 6], &[0, 1, 3], &[2, 3, 6], &[0, 2, 4], &[1, 2, 5]],
];

/// The numbers of factors that such a design can have.
pub(super) const BOX_BEHNKEN_FACTORS: std::ops::RangeInclusive<usize> = 3..=7;

/// The points of a Box–Behnken design but its centre: −1, 0 and 1 for the low, middle and high level of each factor. Within a
/// block every combination of low and high, the last factor varying fastest.
pub(super) fn edges(factors: usize) -> Vec<Vec<i8>> {
    let Some(blocks) = factors.checked_sub(3).and_then(|index| BLOCKS.get(index)) else { return Vec::new() };
    let mut points = Vec::new();
    for block in *blocks {
        for index in 0..1_u64 << block.len() {
            let mut point = vec![0; factors];
            for (factor, digit) in block.iter().zip(digits(&vec![2; block.len()], index)) {
                point[*factor] = if digit == 0 { -1 } else { 1 };
            }
            points.push(point);
        }
    }
    points
}
