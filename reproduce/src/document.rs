//! `report.json`, and `report.md`, its simulated rows as Markdown tables for documents.

use roost_terminal::format::significant;
use serde::{Deserialize, Serialize};

use crate::report::{counts, significant_to, value};
use crate::row::Row;

/// Schema name of `report.json`.
pub(crate) const SCHEMA: &str = "roost.report/1";

/// The document `report.json`.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Document {
    pub(crate) schema: String,
    /// Name of the profile, such as `standard`.
    pub(crate) profile: String,
    /// Machines and backends that ran the simulations.
    pub(crate) machine: String,
    /// Version of the solver crate.
    pub(crate) version: String,
    /// Its `SOLVER_REVISION`.
    pub(crate) solver_revision: u32,
    /// Whether all simulations of every figure have ended.
    pub(crate) complete: bool,
    pub(crate) rows: Vec<Row>,
}

impl Document {
    /// Its text.
    pub(crate) fn json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("rows serialise");
        text.push('\n');
        text
    }

    /// `report.md`: the summary, and a table per figure.
    pub(crate) fn markdown(&self) -> String {
        let section = |figure| format!("\n## {figure}\n\n{}", self.figure_markdown(figure));
        self.summary_markdown() + &self.figures().into_iter().map(section).collect::<String>()
    }

    /// Origin of the numbers and how many demands hold, as a Markdown table.
    fn summary_markdown(&self) -> String {
        let (holds, fails) = counts(self.rows.iter());
        format!(
            "| profile | solver revision | computed on | demands | met |\n|---|---|---|---|---|\n| `--{}` | {} | {} | {} | {holds} |\n",
            self.profile,
            self.solver_revision,
            self.machine,
            holds + fails
        )
    }

    /// The simulated rows of a figure or table as a Markdown table; empty if there are none.
    fn figure_markdown(&self, figure: &str) -> String {
        let rows: Vec<&Row> = self.rows.iter().filter(|row| row.figure == figure && row.n > 0).collect();
        if rows.is_empty() {
            return String::new();
        }
        let mut text =
            String::from("| quantity | paper | Roost | n | demand | met |\n|---|---|---|---|---|---|\n");
        for row in rows {
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
                format!("{}{unit}", row.quantity),
                value(&row.paper),
                format!("{measured}{interval}"),
                row.n.to_string(),
                row.demand.clone().unwrap_or_default(),
                met.to_owned(),
            ];
            text += &format!("| {} |\n", cells.map(|cell| cell.replace('|', "\\|")).join(" | "));
        }
        text
    }

    /// Names of the figures and tables with simulated rows, in order.
    fn figures(&self) -> Vec<&str> {
        let mut names: Vec<&str> =
            self.rows.iter().filter(|row| row.n > 0).map(|row| row.figure.as_str()).collect();
        names.dedup();
        names
    }
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
    use crate::row::Demand;

    #[test]
    fn tables_have_the_digits_that_the_interval_supports() {
        let row = |values: &[f64]| Row::new("Fig. 14", "mass at 4 s", "kg").paper(33.2).values(values);
        let rows = vec![
            row(&[31.0, 33.0]).demand(Demand::Near(33.2, 2.3)),
            row(&[25.0]),
            Row::new("Fig. 14", "given", ""),
        ];
        let document = Document {
            schema: SCHEMA.to_owned(),
            profile: "standard".to_owned(),
            machine: "a machine".to_owned(),
            version: String::new(),
            solver_revision: 3,
            complete: true,
            rows,
        };
        let read: Document = serde_json::from_str(&document.json()).unwrap();
        let table = read.figure_markdown("Fig. 14");
        let lines: Vec<&str> = table.lines().skip(2).collect();
        assert_eq!(
            lines,
            [
                "| mass at 4 s (kg) | 33.2 | 32 ± 13 | 2 | 33.2 ± 2.3 | yes |",
                "| mass at 4 s (kg) | 33.2 | 25 | 1 |  |  |",
            ]
        );
        assert_eq!(read.figures(), ["Fig. 14"]);
        assert!(read.figure_markdown("Fig. 6").is_empty());
        assert!(
            read.markdown().contains("| `--standard` | 3 | a machine | 1 | 1 |\n\n## Fig. 14\n\n| quantity")
        );
    }
}
