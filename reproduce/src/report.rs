//! The report: `report.html`, one file that needs no network, and the data of `report.json`.
//!
//! Both depend on the records only: the same runs give the same bytes.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use roost_solver::{SOLVER_REVISION, VERSION};
use roost_terminal::format::{duration, significant};
use serde_json::Value;

use crate::document::{Document, Finding, SCHEMA};
use crate::numbers::{percent, significant_to, value};
use crate::plan::{Evaluation, Figure, Illustration};
use crate::profile::Profile;
use crate::record::Record;
use crate::row::{Row, counts};

const STYLE: &str = include_str!("report.css");
const PAPER: &str = "M. Vink, H. Shi, J. Jovanova, J. W. Kortlever, D. Schott, Modelling of chicken breast fillets for \
                     advanced poultry process automation, Applied Food Research 6(1), 101880 (2026)";
const DOI: &str = "https://doi.org/10.1016/j.afres.2026.101880";

/// The runs of a figure, and its evaluation once all have ended.
pub(crate) struct Section<'a> {
    pub(crate) figure: &'a Figure,
    /// For each run its record, its error message, or none if it has not ended.
    pub(crate) ended: Vec<Option<Result<&'a Record, &'a str>>>,
    /// None until all runs have ended.
    pub(crate) evaluation: Option<Evaluation>,
}

impl Section<'_> {
    /// The rows of the evaluation; empty until all runs have ended.
    pub(crate) fn rows(&self) -> &[Row] {
        self.evaluation.as_ref().map_or(&[], |evaluation| &evaluation.rows)
    }

    /// The findings of the evaluation.
    fn findings(&self) -> impl Iterator<Item = Finding> {
        let findings = self.evaluation.iter().flat_map(|evaluation| &evaluation.findings);
        findings.map(|text| Finding { figure: self.figure.name.to_owned(), text: text.clone() })
    }

    /// The number of demands that hold, as a text.
    pub(crate) fn demands_text(&self) -> String {
        match (self.evaluation.is_some(), counts(self.rows().iter())) {
            (false, _) => "not run yet".to_owned(),
            (true, (0, 0)) => "–".to_owned(),
            (true, (holds, fails)) => format!("{holds} of {}", holds + fails),
        }
    }

    fn anchor(&self) -> String {
        self.figure.name.to_lowercase().replace([' ', '.', ','], "")
    }
}

/// All data of a report.
pub(crate) struct Report<'a> {
    pub(crate) profile: &'a Profile,
    pub(crate) machine: String,
    /// Commit of the source, if it was given.
    pub(crate) commit: Option<String>,
    pub(crate) sections: Vec<Section<'a>>,
}

impl Report<'_> {
    pub(crate) fn rows(&self) -> impl Iterator<Item = &Row> {
        self.sections.iter().flat_map(|section| section.rows())
    }

    /// `report.json`.
    pub(crate) fn document(&self) -> Document {
        Document {
            schema: SCHEMA.to_owned(),
            profile: self.profile.name.to_owned(),
            machine: self.machine.clone(),
            version: VERSION.to_owned(),
            solver_revision: SOLVER_REVISION,
            commit: self.commit.clone(),
            complete: self.sections.iter().all(|section| section.evaluation.is_some()),
            rows: self.rows().cloned().collect(),
            findings: self.sections.iter().flat_map(Section::findings).collect(),
        }
    }

    /// `report.html`.
    pub(crate) fn html(&self) -> String {
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
                    @for section in &self.sections { (section_html(section)) }
                }
            }
        };
        page.into_string()
    }

    fn preface(&self) -> Markup {
        html! {
            p {
                "Simulations of the figures and tables of the paper. Profile " strong { (self.profile.name) } ", Roost "
                (VERSION) ", solver revision " (SOLVER_REVISION) ". Computed on "
                (self.machine) "."
            }
            p {
                "The column " em { "paper" } " has only numbers from the paper's text; its plots were not digitised. A "
                em { "demand" } " is a fair test of the model, which may differ from the paper's statement. A row without a \
                demand is only reported. A value with ± is the mean over n simulations with its 95 % interval (Student)."
            }
        }
    }

    fn overview(&self) -> Markup {
        let (holds, fails) = counts(self.rows());
        html! {
            h3 { (holds) " of " (holds + fails) " demands on simulations hold" }
            p {
                "Differences from the paper that no demand covers are in the sections below. Read them before a number is used in a \
                design."
            }
            div.wide { table {
                thead { tr { th { "figure" } th { "demands that hold" } th { "demands that do not hold" } } }
                tbody {
                    @for section in &self.sections {
                        tr {
                            td { a href={ "#" (section.anchor()) } { (section.figure.title) } }
                            td.number { (section.demands_text()) }
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

fn section_html(section: &Section<'_>) -> Markup {
    html! {
        section id=(section.anchor()) {
            h2 { (section.figure.title) }
            p.said { strong { "The paper. " } (section.figure.paper) }
            @if let Some(evaluation) = &section.evaluation {
                (rows_html(&evaluation.rows))
                (illustrations_html(&evaluation.illustrations))
                @if !evaluation.findings.is_empty() {
                    h3 { "Differences and assumptions" }
                    ul { @for finding in &evaluation.findings { li { (finding) } } }
                }
            } @else {
                @let ended = section.ended.iter().flatten().count();
                p { "Not run yet: " (ended) " of " (section.ended.len()) " simulations have ended." }
            }
            (runs_html(section))
        }
    }
}

fn rows_html(rows: &[Row]) -> Markup {
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
                        td.number { @if let Some(share) = row.relative_difference() { (percent(share)) } }
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

fn illustrations_html(illustrations: &[Illustration]) -> Markup {
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

fn runs_html(section: &Section<'_>) -> Markup {
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
                            @if let Some(Ok(record)) = ended { (record_html(&run.name, record)) }
                        }
                    }
                } }
            }
        }
    }
}

fn record_html(name: &str, record: &Record) -> Markup {
    let (result, cost) = (&record.result, &record.result.performance);
    let reason = serde_json::to_value(result.end_reason).ok();
    let reason = reason.as_ref().and_then(Value::as_str).unwrap_or_default().replace('_', " ");
    html! {
        tr {
            td { (name) }
            td.number { (result.scenario.seed) }
            td { (reason) @if let Some(instability) = &result.instability { ": " (instability.reason) } }
            td.number { (cost.subparticles) }
            td.number { (significant(result.solver.timestep_s)) }
            td.number { (cost.steps) }
            td.number { (duration(cost.wall_s)) }
            td { code { (&result.scenario_digest[..12]) } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Part;
    use crate::profile::PROFILES;
    use crate::row::Demand;

    fn figure() -> Figure {
        Figure {
            name: "Fig. 14",
            title: "Fig. 14: mass",
            part: Part::Hopper,
            paper: "33.2 kg <in> 4 s",
            runs: Vec::new(),
            evaluate: |_, _| Evaluation::default(),
        }
    }

    fn report<'a>(figure: &'a Figure, evaluation: Option<Evaluation>) -> Report<'a> {
        let sections = vec![Section { figure, ended: Vec::new(), evaluation }];
        Report { profile: PROFILES[0], machine: "a machine".to_owned(), commit: None, sections }
    }

    #[test]
    fn failed_demands_are_counted_and_named() {
        let row = |kg| {
            Row::new("Fig. 14", "mass out at 4 s", "kg")
                .paper(33.2)
                .single(Some(kg))
                .demand(Demand::Near(33.2, 2.3))
        };
        let figure = figure();
        let evaluation = Evaluation { rows: vec![row(33.0), row(16.6)], ..Evaluation::default() };
        let report = report(&figure, Some(evaluation));
        let document: Value = serde_json::from_str(&report.document().json()).unwrap();
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
        assert!(html.contains("33.2 kg &lt;in&gt; 4 s"), "texts are escaped");
    }

    #[test]
    fn figures_without_runs_are_marked() {
        let figure = figure();
        let report = report(&figure, None);
        assert!(report.html().contains("Not run yet"));
        assert_eq!(serde_json::from_str::<Value>(&report.document().json()).unwrap()["complete"], false);
    }

    #[test]
    fn page_needs_no_network() {
        let figure = figure();
        let html = report(&figure, Some(Evaluation::default())).html();
        let fetching = ["<script", "<link", "src=", "@import", "url("];
        assert!(fetching.iter().all(|word| !html.contains(word)));
    }
}
