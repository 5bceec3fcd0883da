//! The report: `report.json` for programs, `report.html` for people, one file without a network.
//!
//! Both are a function of the records alone: the same runs give the same bytes.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use roost_solver::{SOLVER_REVISION, VERSION};
use serde::Serialize;
use serde_json::Value;

use super::plan::{Figure, Illustration, Told};
use super::profile::Profile;
use super::record::Record;
use super::row::Row;
use crate::ui::format::{duration, significant};

const STYLE: &str = include_str!("report.css");
const PAPER: &str = "M. Vink, H. Shi, J. Jovanova, J. W. Kortlever, D. Schott, Modelling of chicken breast fillets for \
                     advanced poultry process automation, Applied Food Research 6(1), 101880 (2026)";
const DOI: &str = "https://doi.org/10.1016/j.afres.2026.101880";

/// A figure's runs as far as they have ended, and what it tells once all have.
pub(super) struct Section<'a> {
    pub(super) figure: &'a Figure,
    /// As many as runs: its record, what went wrong, or none when it has not run.
    pub(super) ended: Vec<Option<Result<&'a Record, &'a str>>>,
    pub(super) told: Option<Told>,
}

impl Section<'_> {
    /// What it tells in rows; none until all of its runs have ended.
    pub(super) fn rows(&self) -> &[Row] {
        self.told.as_ref().map_or(&[], |told| &told.rows)
    }

    /// How many of its demands hold, in words.
    pub(super) fn held(&self) -> String {
        match (self.told.is_some(), counts(self.rows().iter())) {
            (false, _) => "not run yet".to_owned(),
            (true, (0, 0)) => "–".to_owned(),
            (true, (holds, fails)) => format!("{holds} of {}", holds + fails),
        }
    }

    fn anchor(&self) -> String {
        self.figure.name.to_lowercase().replace([' ', '.', ','], "")
    }
}

/// All there is to report.
pub(super) struct Report<'a> {
    pub(super) profile: &'a Profile,
    pub(super) machine: String,
    pub(super) sections: Vec<Section<'a>>,
}

/// The schema name of the document.
const SCHEMA: &str = "roost.report/1";

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    profile: &'static str,
    machine: &'a str,
    version: &'static str,
    solver_revision: u32,
    /// Whether every figure has all of its runs.
    complete: bool,
    rows: Vec<&'a Row>,
}

/// How many demands on simulations hold, and how many do not. What is given, such as shapes and parameters, does not count.
fn counts<'a>(rows: impl Iterator<Item = &'a Row>) -> (usize, usize) {
    let rows = rows.filter(|row| row.n > 0 || row.holds == Some(false));
    rows.fold((0, 0), |(holds, fails), row| match row.holds {
        Some(true) => (holds + 1, fails),
        Some(false) => (holds, fails + 1),
        None => (holds, fails),
    })
}

impl Report<'_> {
    pub(super) fn rows(&self) -> impl Iterator<Item = &Row> {
        self.sections.iter().flat_map(|section| section.rows())
    }

    /// `report.json`.
    pub(super) fn json(&self) -> String {
        let document = Document {
            schema: SCHEMA,
            profile: self.profile.name,
            machine: &self.machine,
            version: VERSION,
            solver_revision: SOLVER_REVISION,
            complete: self.sections.iter().all(|section| section.told.is_some()),
            rows: self.rows().collect(),
        };
        let mut text = serde_json::to_string_pretty(&document).expect("rows serialise");
        text.push('\n');
        text
    }

    /// `report.html`.
    pub(super) fn html(&self) -> String {
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { "Chicken fillets: the paper beside Roost" }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    h1 { "Chicken fillets: the paper beside Roost" }
                    p { (PAPER) ", " a href=(DOI) { "doi:10.1016/j.afres.2026.101880" } "." }
                    (self.preface())
                    (self.overview())
                    @for section in &self.sections { (of_section(section)) }
                }
            }
        };
        page.into_string()
    }

    fn preface(&self) -> Markup {
        html! {
            p {
                "Every figure and table of the paper, simulated anew: profile " strong { (self.profile.name) } ", Roost "
                (VERSION) ", revision " (SOLVER_REVISION) " of the solver. Computed on "
                (self.machine) "."
            }
            p {
                "The column " em { "paper" } " has only numbers that the paper's text quotes; its plots are not read off. "
                em { "Demand" } " is what an honest test asks of the model, which is not always what the paper says; a row \
                without one is reported as it comes out. A value with ± is the mean over n simulations with its 95 % \
                interval (Student)."
            }
        }
    }

    fn overview(&self) -> Markup {
        let (holds, fails) = counts(self.rows());
        html! {
            h3 { (holds) " of " (holds + fails) " demands on simulations hold" }
            p {
                "A demand is what an honest test asks of the model. What differs from the paper and carries none is in the sections: "
                "look there before trusting a number to design with."
            }
            div.wide { table {
                thead { tr { th { "figure" } th { "demands that hold" } th { "those that do not" } } }
                tbody {
                    @for section in &self.sections {
                        tr {
                            td { a href={ "#" (section.anchor()) } { (section.figure.title) } }
                            td.number { (section.held()) }
                            td {
                                @for row in section.rows().iter().filter(|row| row.holds == Some(false)) {
                                    div.no { (row.quantity) }
                                }
                            }
                        }
                    }
                }
            } }
        }
    }
}

fn of_section(section: &Section<'_>) -> Markup {
    html! {
        section id=(section.anchor()) {
            h2 { (section.figure.title) }
            p.said { strong { "The paper. " } (section.figure.paper) }
            @if let Some(told) = &section.told {
                (of_rows(&told.rows))
                (of_illustrations(&told.illustrations))
                @if !told.findings.is_empty() {
                    h3 { "What does not reproduce, and what to know" }
                    ul { @for finding in &told.findings { li { (finding) } } }
                }
            } @else {
                @let ended = section.ended.iter().flatten().count();
                p { "Not run yet: " (ended) " of " (section.ended.len()) " simulations are there." }
            }
            (of_runs(section))
        }
    }
}

fn of_rows(rows: &[Row]) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th { "quantity" } th { "paper" } th { "measured" } th { "difference" } th { "n" } th { "demand" } th { "holds" }
            } }
            tbody {
                @for row in rows {
                    tr {
                        td { (row.quantity) @if !row.note.is_empty() { small { (row.note) } } }
                        td.number { (value(&row.paper)) }
                        td.number {
                            (value(&row.measured))
                            @if let Some(half) = row.half_width_95 { " ± " (significant_to(half, 2)) }
                            @if !row.unit.is_empty() && row.measured.is_number() { " " (row.unit) }
                        }
                        td.number { @if let Some(share) = row.difference() { (percent(share)) } }
                        td.number { @if row.n > 0 { (row.n) } }
                        td { @if let Some(demand) = &row.demand { (demand) } }
                        td {
                            @match row.holds {
                                Some(true) => span.yes { "✓ yes" },
                                Some(false) => span.no { "✗ no" },
                                None => {},
                            }
                        }
                    }
                }
            }
        } }
    }
}

fn of_illustrations(illustrations: &[Illustration]) -> Markup {
    html! {
        div.pictures {
            @for illustration in illustrations {
                figure.plot {
                    (PreEscaped(&illustration.svg))
                    figcaption { (illustration.caption) }
                }
            }
        }
    }
}

fn of_runs(section: &Section<'_>) -> Markup {
    let runs = || section.figure.runs.iter().zip(&section.ended);
    html! {
        @for (run, ended) in runs() {
            @if let Some(Err(message)) = ended { p.no { (run.name) " failed: " (message) } }
        }
        @if !section.figure.runs.is_empty() {
            details {
                summary { (section.figure.runs.len()) " simulations" }
                div.wide { table {
                    thead { tr {
                        th { "run" } th { "seed" } th { "ended" } th { "sub-particles" } th { "time step (s)" } th { "steps" }
                        th { "wall time" } th { "scenario" }
                    } }
                    tbody {
                        @for (run, ended) in runs() {
                            @if let Some(Ok(record)) = ended { (of_record(&run.name, record)) }
                        }
                    }
                } }
            }
        }
    }
}

fn of_record(name: &str, record: &Record) -> Markup {
    let (result, cost) = (&record.result, &record.result.performance);
    let reason = serde_json::to_value(result.end_reason).ok();
    let reason = reason.as_ref().and_then(Value::as_str).unwrap_or_default().replace('_', " ");
    html! {
        tr {
            td { (name) }
            td.number { (result.scenario.seed) }
            td { (reason) @if let Some(seen) = &result.instability { ": " (seen.reason) } }
            td.number { (cost.subparticles) }
            td.number { (significant(result.solver.timestep_s)) }
            td.number { (cost.steps) }
            td.number { (duration(cost.wall_s)) }
            td { code { (&result.scenario_digest[..12]) } }
        }
    }
}

/// A number or words as people read them.
fn value(value: &Value) -> String {
    match value {
        Value::Number(number) => number.as_f64().map_or_else(String::new, significant),
        Value::String(text) => text.clone(),
        _ => "–".to_owned(),
    }
}

/// A share as signed per cent.
fn percent(share: f64) -> String {
    if share.abs() < 5e-4 {
        return "0 %".to_owned();
    }
    let text = significant_to(100.0 * share, 2);
    if share > 0.0 { format!("+{text} %") } else { format!("{} %", text.replace('-', "−")) }
}

/// So many significant digits.
fn significant_to(value: f64, digits: i32) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let step = 10f64.powi(value.abs().log10().floor() as i32 + 1 - digits);
    significant((value / step).round() * step)
}

#[cfg(test)]
mod tests {
    use super::super::plan::Part;
    use super::super::profile::PROFILES;
    use super::super::row::Demand;
    use super::*;

    fn figure() -> Figure {
        Figure {
            name: "Fig. 14",
            title: "Fig. 14: mass",
            part: Part::Hopper,
            paper: "33.2 kg <in> 4 s",
            runs: Vec::new(),
            tell: |_, _| Told::default(),
        }
    }

    fn report<'a>(figure: &'a Figure, told: Option<Told>) -> Report<'a> {
        let sections = vec![Section { figure, ended: Vec::new(), told }];
        Report { profile: PROFILES[0], machine: "a machine".to_owned(), sections }
    }

    #[test]
    fn what_fails_is_counted_named_and_false() {
        let row = |kg| {
            Row::new("Fig. 14", "mass out at 4 s", "kg")
                .paper(33.2)
                .one(Some(kg))
                .demand(Demand::Near(33.2, 2.3))
        };
        let figure = figure();
        let told = Told { rows: vec![row(33.0), row(16.6)], ..Told::default() };
        let report = report(&figure, Some(told));
        let document: Value = serde_json::from_str(&report.json()).unwrap();
        assert_eq!(document["schema"], "roost.report/1");
        assert_eq!(document["complete"], true);
        assert_eq!(
            (&document["rows"][0]["holds"], &document["rows"][1]["holds"]),
            (&true.into(), &false.into())
        );
        let html = report.html();
        assert!(
            html.contains("1 of 2 demands on simulations hold")
                && html.contains("✗ no")
                && html.contains("−50 %"),
            "{html}"
        );
        assert!(html.contains("33.2 kg &lt;in&gt; 4 s"), "text is escaped");
    }

    #[test]
    fn what_has_not_run_is_said() {
        let figure = figure();
        let report = report(&figure, None);
        assert!(report.html().contains("Not run yet"));
        assert_eq!(serde_json::from_str::<Value>(&report.json()).unwrap()["complete"], false);
    }

    #[test]
    fn the_page_needs_no_network() {
        let figure = figure();
        let html = report(&figure, Some(Told::default())).html();
        let fetching = ["<script", "<link", "src=", "@import", "url("];
        assert!(fetching.iter().all(|word| !html.contains(word)));
    }

    #[test]
    fn numbers_for_people() {
        let shown = [0.0712, -0.5, 1.5, 3e-6].map(percent);
        assert_eq!(shown, ["+7.1 %", "−50 %", "+150 %", "0 %"]);
        assert_eq!([significant_to(0.01234, 2), significant_to(0.0, 2)], ["0.012", "0"]);
    }
}
