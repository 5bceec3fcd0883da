//! Progress of a report on stderr: a bar for the figure under way, one for everything.

use std::time::Instant;

use super::plan::Plan;
use crate::ui::format::time_left;
use crate::ui::meter::{Meter, Meters};

/// How far each task has come; figures and all are sums over tasks, weighed by cost.
pub(super) struct Progress<'a> {
    plan: &'a Plan,
    /// For each figure the tasks that had to be run.
    fresh: Vec<Vec<usize>>,
    /// For each task.
    fractions: Vec<f64>,
    has_ended: Vec<bool>,
    started: Instant,
    meters: Meters,
    figures: Vec<Option<(Meter, Instant)>>,
    all: Option<Meter>,
}

impl<'a> Progress<'a> {
    /// For the tasks that are to be run, by index.
    pub(super) fn new(plan: &'a Plan, order: &[usize]) -> Self {
        let is_fresh = |index: &usize| order.contains(index);
        let fresh: Vec<Vec<usize>> =
            plan.uses.iter().map(|used| used.iter().copied().filter(is_fresh).collect()).collect();
        let meters = Meters::default();
        Self {
            fractions: vec![0.0; plan.tasks.len()],
            has_ended: vec![false; plan.tasks.len()],
            started: Instant::now(),
            all: (!order.is_empty()).then(|| meters.add("all")),
            figures: fresh.iter().map(|_| None).collect(),
            meters,
            plan,
            fresh,
        }
    }

    /// A task has come so far.
    pub(super) fn show(&mut self, index: usize, fraction: f64) {
        self.fractions[index] = fraction;
        // Tasks that several figures share count for the first of them.
        if let Some(number) = self.fresh.iter().position(|used| used.contains(&index)) {
            self.show_figure(number);
        }
        let all: Vec<usize> =
            (0..self.plan.tasks.len()).filter(|i| self.fresh.iter().any(|used| used.contains(i))).collect();
        let (fraction, words) = self.describe(&all, self.started);
        if let Some(meter) = &mut self.all {
            meter.show(fraction, words);
        }
    }

    /// A task is over; returns whether that completes a figure.
    pub(super) fn ended(&mut self, index: usize) -> bool {
        self.has_ended[index] = true;
        self.show(index, 1.0);
        let mut completes = false;
        for number in 0..self.fresh.len() {
            let used = &self.fresh[number];
            if used.contains(&index) && used.iter().all(|task| self.has_ended[*task]) {
                completes = true;
                if let Some((meter, since)) = self.figures[number].take() {
                    let words = format!(
                        "{} runs in {}",
                        used.len(),
                        crate::ui::format::duration(since.elapsed().as_secs_f64())
                    );
                    meter.finish(1.0, words);
                }
            }
        }
        completes
    }

    fn show_figure(&mut self, number: usize) {
        let since = self.figures[number].as_ref().map_or_else(Instant::now, |(_, since)| *since);
        let (fraction, words) = self.describe(&self.fresh[number], since);
        let figure = &mut self.figures[number];
        let name = self.plan.figures[number].name;
        let (meter, _) = figure.get_or_insert_with(|| (self.meters.add(name), since));
        meter.show(fraction, words);
    }

    /// The share of some tasks that is done, and in words.
    fn describe(&self, tasks: &[usize], since: Instant) -> (f64, String) {
        let cost = |index: &usize| self.plan.tasks[*index].cost.max(1e-9);
        let done = tasks.iter().map(|index| cost(index) * self.fractions[*index]).sum::<f64>();
        let fraction = done / tasks.iter().map(cost).sum::<f64>();
        let ended = tasks.iter().filter(|index| self.has_ended[**index]).count();
        let left = time_left(fraction, since.elapsed().as_secs_f64());
        let left = left.map(|left| format!(" · {left}")).unwrap_or_default();
        (fraction, format!("{ended} of {} runs{left}", tasks.len()))
    }
}

impl Drop for Progress<'_> {
    /// Takes away the bars of what was not finished.
    fn drop(&mut self) {
        let unfinished = self.figures.iter_mut().filter_map(|figure| figure.take().map(|(meter, _)| meter));
        unfinished.chain(self.all.take()).for_each(Meter::clear);
    }
}
