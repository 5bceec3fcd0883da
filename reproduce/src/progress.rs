//! Progress of a report on stderr: a bar for each figure under way, and one for the whole report.

use std::time::Instant;

use roost_terminal::format::{duration, time_left};
use roost_terminal::progress::{Bar, Bars};

use crate::plan::Plan;

/// Progress of all tasks. The progress of a figure is the mean over its tasks, weighted by cost.
pub(crate) struct Progress<'a> {
    plan: &'a Plan,
    /// For each figure, the tasks that have no record yet.
    pending: Vec<Vec<usize>>,
    /// Fraction done of each task.
    fractions: Vec<f64>,
    has_ended: Vec<bool>,
    started: Instant,
    bars: Bars,
    figures: Vec<Option<(Bar, Instant)>>,
    total: Option<Bar>,
}

impl<'a> Progress<'a> {
    /// Progress of the tasks with these indices.
    pub(crate) fn new(plan: &'a Plan, order: &[usize]) -> Self {
        let is_pending = |index: &usize| order.contains(index);
        let pending: Vec<Vec<usize>> =
            plan.uses.iter().map(|used| used.iter().copied().filter(is_pending).collect()).collect();
        let bars = Bars::default();
        Self {
            fractions: vec![0.0; plan.tasks.len()],
            has_ended: vec![false; plan.tasks.len()],
            started: Instant::now(),
            total: (!order.is_empty()).then(|| bars.add("all")),
            figures: pending.iter().map(|_| None).collect(),
            bars,
            plan,
            pending,
        }
    }

    /// Sets the fraction done of a task.
    pub(crate) fn update(&mut self, index: usize, fraction: f64) {
        self.fractions[index] = fraction;
        // A task of several figures counts for the first of them.
        if let Some(number) = self.pending.iter().position(|used| used.contains(&index)) {
            self.update_figure(number);
        }
        let is_pending = |index: &usize| self.pending.iter().any(|used| used.contains(index));
        let tasks: Vec<usize> = (0..self.plan.tasks.len()).filter(is_pending).collect();
        let (fraction, text) = self.describe(&tasks, self.started);
        if let Some(bar) = &mut self.total {
            bar.update(fraction, &text);
        }
    }

    /// Ends a task. Returns whether that completes a figure.
    pub(crate) fn end(&mut self, index: usize) -> bool {
        self.has_ended[index] = true;
        self.update(index, 1.0);
        let mut completes = false;
        for number in 0..self.pending.len() {
            let used = &self.pending[number];
            if used.contains(&index) && used.iter().all(|task| self.has_ended[*task]) {
                completes = true;
                if let Some((bar, since)) = self.figures[number].take() {
                    let took = duration(since.elapsed().as_secs_f64());
                    bar.finish(1.0, &format!("{} runs in {took}", used.len()));
                }
            }
        }
        completes
    }

    fn update_figure(&mut self, number: usize) {
        let since = self.figures[number].as_ref().map_or_else(Instant::now, |(_, since)| *since);
        let (fraction, text) = self.describe(&self.pending[number], since);
        let name = self.plan.figures[number].name;
        let (bar, _) = self.figures[number].get_or_insert_with(|| (self.bars.add(name), since));
        bar.update(fraction, &text);
    }

    /// Fraction done of some tasks, and a text with their number and the time left.
    fn describe(&self, tasks: &[usize], since: Instant) -> (f64, String) {
        let cost = |index: &usize| self.plan.tasks[*index].cost_s.max(1e-9);
        let done = tasks.iter().map(|index| cost(index) * self.fractions[*index]).sum::<f64>();
        let fraction = done / tasks.iter().map(cost).sum::<f64>();
        let ended = tasks.iter().filter(|index| self.has_ended[**index]).count();
        let left = time_left(fraction, since.elapsed().as_secs_f64());
        let left = left.map(|left| format!(" · {left}")).unwrap_or_default();
        (fraction, format!("{ended} of {} runs{left}", tasks.len()))
    }
}

impl Drop for Progress<'_> {
    /// Removes the bars of unfinished figures.
    fn drop(&mut self) {
        let unfinished = self.figures.iter_mut().filter_map(|figure| figure.take().map(|(bar, _)| bar));
        unfinished.chain(self.total.take()).for_each(Bar::clear);
    }
}
