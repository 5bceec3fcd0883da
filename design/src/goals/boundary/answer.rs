//! The answer of the goal: map, band, crossings, and the evidence.

use serde::{Deserialize, Serialize};

use super::Boundary;
use super::band::{Band, Side, misclassified};
use crate::evidence::Point;
use crate::factor::Factor;
use crate::goals::Study;
use crate::intervals::Estimated;
use crate::model::Model;
use crate::space::{grid, snapped};

/// Points of the map per factor, by number of factors.
const STEPS: [usize; super::MAX_FACTORS] = [201, 33, 11, 6];

/// Where the boundary is, with 95 % confidence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// Part of the range is below the level, and part above.
    Inside,
    /// Nowhere in the range: all of it is below the level.
    NowhereAllBelow,
    /// Nowhere in the range: all of it is above the level.
    NowhereAllAbove,
    /// Not known yet.
    Unknown,
}

/// A point of the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapPoint {
    /// Values of the factors, in their units.
    pub values: Vec<f64>,
    /// The probability or mean, in the unit of the response.
    pub estimate: f64,
    /// Lower end of its interval, at the confidence of the whole band.
    pub low: f64,
    /// Upper end of its interval.
    pub high: f64,
    /// The side of the boundary.
    pub side: Side,
}

/// A stretch of a single factor in which the side of the level is not known with 95 % confidence, or changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Crossing {
    /// Lower end, in the unit of the factor: the last point of the map on a known side, or the lower end of the range.
    pub low: f64,
    /// Upper end: the first point on a known side, or the upper end of the range.
    pub high: f64,
    /// Values at which the estimate crosses the level within the interval; between two whole numbers where the factor has such.
    pub estimates: Vec<f64>,
    /// Whether both ends are on known and different sides. The model then has the level crossed in between with 95 % confidence,
    /// as all that the band says; this is no proof. Either end may be an end of the range.
    pub is_certain: bool,
}

/// A point of the evidence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObservedPoint {
    /// Values of the factors, in their units.
    pub values: Vec<f64>,
    /// Estimate and interval from the runs at this point alone.
    pub estimated: Estimated,
}

/// The finding of the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoundaryAnswer {
    /// The level, in the unit of the response.
    pub level: f64,
    /// Expected share of the range on the wrong side of the estimated boundary; none without a model.
    pub misclassified: Option<f64>,
    /// The share at which the study ends.
    pub asked: f64,
    /// Where the boundary is.
    pub place: Place,
    /// One factor: intervals of the crossings, in rising order.
    pub crossings: Vec<Crossing>,
    /// The map, the last factor varying fastest; empty without a model.
    pub map: Vec<MapPoint>,
    /// Half the width of the band, in standard deviations of the latent function; none without a model.
    pub band_deviations: Option<f64>,
    /// Length scale of each factor in the model, in widths of its range: short ones matter most; empty without a model.
    pub length_scales: Vec<f64>,
    /// The points with results, in canonical order.
    pub observed: Vec<ObservedPoint>,
}

impl BoundaryAnswer {
    pub(super) fn of(goal: &Boundary, study: &Study<'_>, model: Option<&Model>) -> Self {
        let factors = study.factors;
        let observed = study.usable_points().filter_map(|runs| {
            let estimated = Estimated::of(&goal.of, &runs.values(&goal.of))?;
            Some(ObservedPoint { values: runs.point.values(factors), estimated })
        });
        let mut answer = Self {
            level: goal.level,
            misclassified: None,
            asked: goal.misclassified,
            place: Place::Unknown,
            crossings: Vec::new(),
            map: Vec::new(),
            band_deviations: None,
            length_scales: Vec::new(),
            observed: observed.collect(),
        };
        if let Some(model) = model {
            answer.describe(study, model);
        }
        answer
    }

    fn describe(&mut self, study: &Study<'_>, model: &Model) {
        let factors = study.factors;
        let points = map_points(factors);
        let level = model.latent(self.level);
        let band = Band::of(model, &points, level, study.seed);
        self.misclassified = Some(misclassified(model, factors, level, study.seed));
        self.band_deviations = Some(band.multiplier);
        self.length_scales = model.posterior.kernel().lengths.clone();
        let sides: Vec<Side> = (0..points.len()).map(|point| band.side(point)).collect();
        let has = |side: Side| sides.contains(&side);
        self.place = match (has(Side::Below), has(Side::Above), has(Side::Band)) {
            (true, true, _) => Place::Inside,
            (true, false, false) => Place::NowhereAllBelow,
            (false, true, false) => Place::NowhereAllAbove,
            _ => Place::Unknown,
        };
        if let [factor] = factors {
            let coordinates: Vec<f64> = points.iter().map(|point| point[0]).collect();
            self.crossings = crossings(&band, &sides, factor, &coordinates);
        }
        let map = points.iter().enumerate().map(|(index, coordinates)| {
            let (low, high) = band.interval(index);
            MapPoint {
                values: Point::new(coordinates).values(factors),
                estimate: model.value(band.means[index]),
                low: model.value(low),
                high: model.value(high),
                side: sides[index],
            }
        });
        self.map = map.collect();
    }
}

/// The coordinates of the map. Of one factor with few whole numbers each of them once; else a grid, in which points of neighbouring places may
/// have the same whole number.
fn map_points(factors: &[Factor]) -> Vec<Vec<f64>> {
    let steps = STEPS[factors.len() - 1];
    if let [factor] = factors
        && let Some(count) = factor.count().filter(|count| *count <= steps)
    {
        return (0..count)
            .filter_map(|index| Some(vec![factor.coordinate(factor.low + index as f64)?]))
            .collect();
    }
    grid(steps, factors.len()).into_iter().map(|point| snapped(factors, point)).collect()
}

/// Stretches in which the level is crossed, on a map of one factor.
fn crossings(band: &Band, sides: &[Side], factor: &Factor, coordinates: &[f64]) -> Vec<Crossing> {
    let last = sides.len() - 1;
    let value = |coordinate: f64| factor.value(coordinate);
    let mut found = Vec::new();
    let mut start = 0;
    while start < last {
        // From the last point of a known side to the first point of the next.
        let mut end = start + 1;
        while end < last && sides[end] == Side::Band {
            end += 1;
        }
        let is_band = sides[start..=end].contains(&Side::Band);
        if is_band || sides[start] != sides[end] {
            let is_certain =
                sides[start] != Side::Band && sides[end] != Side::Band && sides[start] != sides[end];
            let estimates = (start..end).filter_map(|point| {
                let (one, other) = (band.means[point] - band.level, band.means[point + 1] - band.level);
                let (before, after) = (coordinates[point], coordinates[point + 1]);
                let at = before + one / (one - other) * (after - before);
                // Between two whole numbers, not at one of them.
                let at = if factor.is_whole { factor.place(at) } else { value(at) };
                (one * other < 0.0).then_some(at)
            });
            found.push(Crossing {
                low: value(coordinates[start]),
                high: value(coordinates[end]),
                estimates: estimates.collect(),
                is_certain,
            });
        }
        start = end;
    }
    found
}
