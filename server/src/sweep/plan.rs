//! From the specification to a plan: factors with their values, and the design. Every fault of both is listed.

use roost_api::Fault;
use roost_api::design::Design as DesignSpec;
use roost_api::sweep::SweepSpec;
use serde_json::{Value, json};

use super::designs::{self, Design, Plan, PlannedFactor, factors};
use super::values::FactorValues;
use super::{factor_pointers, factor_values};
use crate::document::fault;

/// Plans a sweep. `complete` is its complete base, unless the base is at fault. Returns none where the plan is at fault.
pub(super) fn plan(spec: &SweepSpec, complete: Option<&Value>, faults: &mut Vec<Fault>) -> Option<Plan> {
    let before = faults.len();
    let kind = spec.design.kind;
    let design = designs::of_kind(kind);
    let factors = factors(spec);
    factor_pointers::check(&factors, complete, faults);
    check_number(&spec.design, factors.len(), design, faults);
    let mut planned = Vec::new();
    for (index, factor) in factors.iter().enumerate() {
        let at = format!("/factors/{index}");
        let fields: Vec<String> = factor.fields().into_iter().map(str::to_owned).collect();
        let mut values = factor_values::read(&at, factor, (kind, design.values()), faults);
        let base = fields.first().and_then(|field| complete?.pointer(field));
        if let (Some(FactorValues::Levels(levels)), Some(base)) = (&mut values, base) {
            design.drop_known_levels(levels, base);
        }
        planned.extend(values.map(|values| PlannedFactor { fields, values }));
    }
    check_fields(&spec.design, design.fields(), faults);
    let names: Vec<String> = factors.iter().map(|factor| factor.name().to_owned()).collect();
    let parameters = design.read(&spec.design, &names, faults)?;
    (faults.len() == before).then_some(Plan { factors: planned, design, parameters })
}

fn check_number(spec: &DesignSpec, number: usize, design: &dyn Design, faults: &mut Vec<Fault>) {
    let numbers = design.factor_counts();
    if number == 0 && !numbers.contains(&0) {
        let detail = "nothing is varied; replicates alone are a grid without factors";
        faults.push(fault("/factors", json!([]), detail, "at least one factor"));
    } else if !numbers.contains(&number) {
        let detail = format!("{} does not take {number} factors", spec.kind);
        let allowed = format!("{} to {} factors", numbers.start(), numbers.end());
        faults.push(fault("/factors", json!(number), &detail, &allowed));
    }
}

/// Checks which fields of a design are given: `fields` are those that its kind takes.
fn check_fields(spec: &DesignSpec, fields: &[&str], faults: &mut Vec<Fault>) {
    let kind = spec.kind;
    let given = [
        ("points", spec.points.map(|points| json!(points))),
        ("seed", spec.seed.map(|seed| json!(seed))),
        ("rows", spec.rows.as_ref().map(|rows| json!(rows.len()))),
        ("table", spec.table.as_ref().map(|table| json!(table.len()))),
    ];
    for (name, value) in given {
        let at = format!("/design/{name}");
        match (value, fields.contains(&name)) {
            (Some(value), false) => {
                let allowed = match fields {
                    [] => "nothing beside `kind`".to_owned(),
                    fields => format!("{} beside `kind`", fields.join(", ")),
                };
                faults.push(fault(&at, value, &format!("{kind} does not take this field"), &allowed));
            }
            (None, true) if name != "seed" => {
                faults.push(fault(&at, Value::Null, &format!("{kind} needs this field"), ""));
            }
            _ => {}
        }
    }
    if let Some(seed) = spec.seed.filter(|seed| *seed > (1 << 53) - 1) {
        faults.push(fault("/design/seed", json!(seed), "is out of range", "0 to 2^53 - 1"));
    }
    if spec.points == Some(0) {
        faults.push(fault("/design/points", json!(0), "a sweep has at least one point", "1 or more"));
    }
}
