//! `report.json`, and `report.md`, its simulated rows and findings as Markdown for documents.

use std::collections::BTreeSet;

use clap::ValueEnum;
use roost_solver::SOLVER_REVISION;
use roost_terminal::format::significant;
use serde::{Deserialize, Serialize};

use crate::figures;
use crate::numbers::{significant_to, value};
use crate::plan::Results;
use crate::profile::{Name, Profile};
use crate::row::{Row, counts};

/// Schema name of `report.json`.
pub(crate) const SCHEMA: &str = "roost.report/1";

/// The document `report.json`.
#[derive(Debug, Serialize, Deserialize)]
pub struct Document {
    pub(crate) schema: String,
    /// Name of the profile, such as `standard`.
    pub(crate) profile: String,
    /// Machines and backends that ran the simulations.
    pub(crate) machine: String,
    /// Version of the solver crate.
    pub(crate) version: String,
    /// Its `SOLVER_REVISION`.
    pub(crate) solver_revision: u32,
    /// Commit of the source that wrote the report, if it was given.
    pub(crate) commit: Option<String>,
    /// Whether all simulations of every figure have ended.
    pub(crate) complete: bool,
    pub(crate) rows: Vec<Row>,
    pub(crate) findings: Vec<Finding>,
}

/// A statement on values that do not reproduce, or on an assumption.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Finding {
    /// Figure or table of the paper.
    pub(crate) figure: String,
    pub(crate) text: String,
}

impl Document {
    /// Reads a `report.json`.
    ///
    /// # Errors
    /// If it is no such document.
    pub fn from_json(text: &str) -> serde_json::Result<Self> {
        serde_json::from_str(text)
    }

    /// Its text.
    pub(crate) fn json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("rows serialise");
        text.push('\n');
        text
    }

    /// Reasons why this is no current report of a profile: another profile or solver revision, missing or unknown rows.
    #[must_use]
    pub fn faults(&self, profile: &str) -> Vec<String> {
        let mut faults = Vec::new();
        let mut compare = |what: &str, found: &str, expected: &str| {
            if found != expected {
                faults.push(format!("{what} is {found}, not {expected}"));
            }
        };
        compare("the schema", &self.schema, SCHEMA);
        compare("the profile", &self.profile, profile);
        compare("the solver revision", &self.solver_revision.to_string(), &SOLVER_REVISION.to_string());
        if !self.complete {
            faults.push("some simulations have not ended".to_owned());
        }
        let Ok(name) = Name::from_str(profile, false) else {
            faults.push(format!("there is no profile {profile}"));
            return faults;
        };
        let expected = rows_of(name.profile());
        let (expected, found) = (row_names(&expected), row_names(&self.rows));
        faults.extend(expected.difference(&found).map(|(figure, name)| format!("no row {figure}: {name}")));
        faults.extend(
            found.difference(&expected).map(|(figure, name)| format!("unknown row {figure}: {name}")),
        );
        faults
    }

    /// `report.md`: the summary, and a table per figure.
    pub(crate) fn markdown(&self) -> String {
        let section = |figure| format!("\n## {figure}\n\n{}", self.figure_markdown(figure));
        self.summary_markdown() + &self.figures().into_iter().map(section).collect::<String>()
    }

    /// Origin of the numbers, and for each figure the demands that hold and that do not, as Markdown tables.
    #[must_use]
    pub fn summary_markdown(&self) -> String {
        let (holds, fails) = counts(self.rows.iter());
        let mut text = format!(
            "| profile | solver revision | commit | computed on | demands | met |\n|---|---|---|---|---|---|\n\
             | `--{}` | {} | {} | {} | {} | {holds} |\n\n| figure | demands | met | not met |\n|---|---|---|---|\n",
            self.profile,
            self.solver_revision,
            self.commit.as_deref().unwrap_or("–"),
            cell(&self.machine),
            holds + fails
        );
        for figure in self.figures() {
            let rows = || self.rows.iter().filter(|row| row.figure == figure);
            let (holds, fails) = counts(rows());
            let failed: Vec<&str> =
                rows().filter(|row| row.holds == Some(false)).map(|row| row.quantity.as_str()).collect();
            text += &format!("| {figure} | {} | {holds} | {} |\n", holds + fails, cell(&failed.join("; ")));
        }
        text
    }

    /// The rows of a simulated figure or table as a Markdown table, and its findings as a list; empty if nothing was simulated.
    #[must_use]
    pub fn figure_markdown(&self, figure: &str) -> String {
        if !self.figures().contains(&figure) {
            return String::new();
        }
        let mut text = String::from(
            "| quantity | paper | Roost | n | demand | met | remarks |\n|---|---|---|---|---|---|---|\n",
        );
        for row in self.rows.iter().filter(|row| row.figure == figure) {
            let interval =
                row.half_width_95.map_or_else(String::new, |half| format!(" ± {}", significant_to(half, 2)));
            let measured = match row.measured.as_f64().zip(row.half_width_95) {
                // As many digits as the interval supports.
                Some((mean, half)) if half > 0.0 => rounded_to(mean, half),
                _ => value(&row.measured),
            };
            let unit = if row.unit.is_empty() { String::new() } else { format!(" ({})", row.unit) };
            let met = row.holds.map_or("", |holds| if holds { "yes" } else { "no" });
            let cells = [
                &format!("{}{unit}", row.quantity),
                &value(&row.paper),
                &format!("{measured}{interval}"),
                &row.n.to_string(),
                row.demand.as_deref().unwrap_or_default(),
                met,
                &row.note,
            ];
            text += &format!("| {} |\n", cells.map(cell).join(" | "));
        }
        let findings: Vec<_> = self.findings.iter().filter(|finding| finding.figure == figure).collect();
        if !findings.is_empty() {
            text.push('\n');
        }
        for finding in findings {
            text += &format!("- {}\n", finding.text);
        }
        text
    }

    /// Names of the simulated figures and tables, in order.
    #[must_use]
    pub fn figures(&self) -> Vec<&str> {
        let mut names: Vec<&str> =
            self.rows.iter().filter(|row| row.n > 0).map(|row| row.figure.as_str()).collect();
        names.dedup();
        names
    }
}

/// The rows that a profile defines, without values.
fn rows_of(profile: &Profile) -> Vec<Row> {
    let rows = |figure: &crate::plan::Figure| {
        let runs = figure.runs.iter().map(|run| (run.name.as_str(), None)).collect();
        (figure.evaluate)(profile, &Results { runs }).rows
    };
    figures::all(profile).iter().flat_map(rows).collect()
}

/// Figure and quantity of each row.
fn row_names(rows: &[Row]) -> BTreeSet<(&str, &str)> {
    rows.iter().map(|row| (row.figure.as_str(), row.quantity.as_str())).collect()
}

/// A text for a cell of a Markdown table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

/// A mean to the decimal of the second digit of its half interval.
fn rounded_to(mean: f64, half: f64) -> String {
    let decimals = 1 - half.log10().floor() as i32;
    match usize::try_from(decimals) {
        Ok(decimals) => format!("{mean:.decimals$}").replace('-', "−"),
        Err(_) => significant(mean),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::PROFILES;
    use crate::row::Demand;

    fn document(rows: Vec<Row>) -> Document {
        Document {
            schema: SCHEMA.to_owned(),
            profile: "quick".to_owned(),
            machine: "a machine".to_owned(),
            version: String::new(),
            solver_revision: SOLVER_REVISION,
            commit: Some("0a1b2c3".to_owned()),
            complete: true,
            rows,
            findings: vec![Finding { figure: "Fig. 14".to_owned(), text: "It is circular.".to_owned() }],
        }
    }

    #[test]
    fn tables_have_the_digits_that_the_interval_supports() {
        let row = |values: &[f64]| Row::new("Fig. 14", "mass at 4 s", "kg").paper(33.2).values(values);
        let rows = vec![
            row(&[31.0, 33.0]).demand(Demand::Near(33.2, 2.3)).note("a|b"),
            row(&[25.0]),
            row(&[]).demand(Demand::Near(33.2, 2.3)),
            Row::new("Table 1", "given", ""),
        ];
        let document = document(rows);
        let read = Document::from_json(&document.json()).unwrap();
        let table = read.figure_markdown("Fig. 14");
        let lines: Vec<&str> = table.lines().skip(2).collect();
        assert_eq!(
            lines,
            [
                "| mass at 4 s (kg) | 33.2 | 32 ± 13 | 2 | 33.2 ± 2.3 | yes | the 95 % interval contains a limit of the demand; a\\|b |",
                "| mass at 4 s (kg) | 33.2 | 25 | 1 |  |  |  |",
                "| mass at 4 s (kg) | 33.2 | – | 0 | 33.2 ± 2.3 | no |  |",
                "",
                "- It is circular.",
            ]
        );
        assert_eq!(read.figures(), ["Fig. 14"]);
        assert!(read.figure_markdown("Table 1").is_empty());
        let text = read.markdown();
        assert!(
            text.contains(&format!("| `--quick` | {SOLVER_REVISION} | 0a1b2c3 | a machine | 2 | 1 |")),
            "{text}"
        );
        assert!(text.contains("| Fig. 14 | 2 | 1 | mass at 4 s |\n\n## Fig. 14\n\n| quantity"), "{text}");
    }

    #[test]
    fn current_report_of_a_profile_has_all_its_rows() {
        let current = || document(rows_of(PROFILES[0]));
        assert_eq!(current().faults("quick"), Vec::<String>::new());
        type Change = fn(&mut Document);
        let faults = |change: Change| {
            let mut document = current();
            change(&mut document);
            document.faults("quick")
        };
        let cases: [(Change, &str); 6] = [
            (|d| d.schema.push('0'), "the schema is roost.report/10"),
            (|d| d.profile = "tiny".to_owned(), "the profile is tiny, not quick"),
            (|d| d.solver_revision -= 1, "the solver revision is"),
            (|d| d.complete = false, "some simulations have not ended"),
            (|d| drop(d.rows.pop()), "no row Time step: time step of `auto`"),
            (|d| d.rows.push(Row::new("Fig. 14", "more", "")), "unknown row Fig. 14: more"),
        ];
        for (change, expected) in cases {
            let found = faults(change);
            assert!(found.len() == 1 && found[0].contains(expected), "{expected}: {found:?}");
        }
        assert_eq!(current().faults("other").len(), 2, "another name, and no such profile");
    }
}
