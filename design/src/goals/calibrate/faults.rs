//! Faults of the fields of the goal.

use super::{Calibrate, ParameterPrior, Setup};
use crate::budget::Budget;
use crate::factor::Factor;
use crate::fault::{Fault, fault};

/// Maximum number of measured numbers: each has an emulator, and the time of a decision grows with them.
const MAX_TARGETS: usize = 48;
/// Maximum number of parameters: the posterior of more is not found with a few hundred runs.
const MAX_PARAMETERS: usize = 8;

impl Calibrate {
    pub(crate) fn faults(&self, at: &str, factors: &[Factor], budget: &Budget, faults: &mut Vec<Fault>) {
        let setup = Setup::of(factors);
        let parameters = setup.parameters();
        if !(1..=MAX_PARAMETERS).contains(&parameters.len()) {
            let allowed = format!("1 to {MAX_PARAMETERS} parameters");
            faults.push(fault("/factors", parameters.len(), "unsuitable number of parameters", &allowed));
        }
        for (index, factor) in parameters.iter().enumerate().filter(|(_, factor)| factor.is_whole) {
            let detail = "a calibration needs parameters that change smoothly";
            let allowed = "`low` and `high` of a number that is not whole";
            faults.push(fault(&format!("/factors/{index}"), &factor.name, detail, allowed));
        }
        if !(1..=MAX_TARGETS).contains(&self.targets.len()) {
            let detail = "unsuitable number of measured numbers";
            let allowed = format!("1 to {MAX_TARGETS}");
            faults.push(fault(&format!("{at}/targets"), self.targets.len(), detail, &allowed));
        }
        for (index, target) in self.targets.iter().enumerate() {
            let at = format!("{at}/targets/{index}");
            if setup.test(&target.test).is_none() {
                faults.push(fault(&format!("{at}/test"), &target.test, "no level of the tests", "a test"));
            }
            target.of.faults(&format!("{at}/of"), faults);
        }
        for (index, prior) in self.priors.iter().enumerate() {
            let at = format!("{at}/priors/{index}");
            let names: Vec<&str> = parameters.iter().map(|factor| factor.name.as_str()).collect();
            let factor = parameters.iter().find(|factor| factor.name == prior.parameter);
            if factor.is_none() {
                let (at, allowed) = (format!("{at}/parameter"), names.join(", "));
                faults.push(fault(&at, &prior.parameter, "no parameter of the study", &allowed));
            }
            if self.priors[..index].iter().any(|other| other.parameter == prior.parameter) {
                let at = format!("{at}/parameter");
                faults.push(fault(&at, &prior.parameter, "the parameter has two priors", "one prior"));
            }
            prior_faults(&at, prior, faults);
            if let Some(factor) = factor.filter(|factor| prior.log_normal.is_some() && factor.low < 0.0) {
                let detail =
                    "the range of the parameter reaches below 0, where a log-normal prior has nothing";
                faults.push(fault(&format!("{at}/log_normal"), factor.low, detail, "a normal prior"));
            }
        }
        if let Some(scale) = self.discrepancy.filter(|scale| !(*scale > 0.0 && *scale <= 1.0)) {
            let allowed = "more than 0 and at most 1; left out for none";
            faults.push(fault(
                &format!("{at}/discrepancy"),
                scale,
                "not a share of the measured mean",
                allowed,
            ));
        }
        if !(self.emulator_share > 0.0 && self.emulator_share < 1.0) {
            let at = format!("{at}/emulator_share");
            let allowed = "more than 0 and less than 1";
            faults.push(fault(&at, self.emulator_share, "not a share to end at", allowed));
        }
        let least = (parameters.len() + 3) * setup.tests();
        if budget.max_runs < least {
            let detail = "too few runs for a first model of each test";
            faults.push(fault("/budget/max_runs", budget.max_runs, detail, &format!("at least {least}")));
        }
    }
}

fn prior_faults(at: &str, prior: &ParameterPrior, faults: &mut Vec<Fault>) {
    if prior.normal.is_some() == prior.log_normal.is_some() {
        faults.push(fault(at, prior, "not one distribution", "either `normal` or `log_normal`"));
    }
    let mut check = |name: &str, value: f64, least: f64| {
        if !(value > least && value.is_finite()) {
            let allowed = format!("more than {least}");
            faults.push(fault(&format!("{at}/{name}"), value, "not possible", &allowed));
        }
    };
    if let Some(normal) = prior.normal {
        check("normal/deviation", normal.deviation, 0.0);
    }
    if let Some(log_normal) = prior.log_normal {
        check("log_normal/median", log_normal.median, 0.0);
        check("log_normal/factor", log_normal.factor, 1.0);
    }
}
