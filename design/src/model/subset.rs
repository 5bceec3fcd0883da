//! The points that a model rests on, when there are more than it can take: its cost grows with the cube of their number.

/// The positions of up to `most` points that fill the range evenly: each is the one farthest from those before it.
pub(super) fn spread(points: &[Vec<f64>], most: usize) -> Vec<usize> {
    let square = |one: usize, other: usize| -> f64 {
        points[one].iter().zip(&points[other]).map(|(one, other)| (one - other) * (one - other)).sum()
    };
    let mut distances = vec![f64::INFINITY; points.len()];
    let mut chosen = Vec::new();
    while chosen.len() < most.min(points.len()) {
        // Of equal distances the first point.
        let farthest =
            |one: &usize, other: &usize| distances[*one].total_cmp(&distances[*other]).then(other.cmp(one));
        let Some(next) = (0..points.len()).max_by(farthest) else { break };
        chosen.push(next);
        for (point, distance) in distances.iter_mut().enumerate() {
            *distance = distance.min(square(point, next));
        }
        distances[next] = f64::NEG_INFINITY;
    }
    chosen
}

/// Adds the positions with the smallest values to those chosen, until there are `most`.
pub(super) fn fill(mut chosen: Vec<usize>, values: &[f64], most: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).filter(|position| !chosen.contains(position)).collect();
    order.sort_by(|one, other| values[*one].total_cmp(&values[*other]));
    chosen.extend(order.into_iter().take(most.saturating_sub(chosen.len())));
    chosen.sort_unstable();
    chosen
}
