//! Tests of forecasts against a farm that is simulated apart from them.

use fastrand::Rng;

use super::*;

/// A standard normal value.
fn normal(random: &mut Rng) -> f64 {
    (-2.0 * (1.0 - random.f64()).ln()).sqrt() * (std::f64::consts::TAU * random.f64()).cos()
}

/// A farm whose runs take the check's estimate of 60 s times a lognormal ratio.
struct World {
    random: Rng,
    /// Median ratio.
    median: f64,
    /// σ of the logarithm.
    sigma: f64,
    slots: usize,
}

/// The check's estimate of each run, in seconds.
const ESTIMATE_S: f64 = 60.0;

impl World {
    fn took_s(&mut self) -> f64 {
        ESTIMATE_S * self.median * (self.sigma * normal(&mut self.random)).exp()
    }

    /// Start of job `first` and end of the last job of a queue, when all slots are taken for `left_s`.
    fn truth(&mut self, left_s: &[f64], first: usize, jobs: usize) -> (f64, f64) {
        let mut free: Vec<f64> = left_s.to_vec();
        free.resize(self.slots, 0.0);
        let (mut start_s, mut end_s) = (0.0, 0.0_f64);
        for job in 0..jobs {
            let slot = (0..free.len()).min_by(|a, b| free[*a].total_cmp(&free[*b])).unwrap();
            if job == first {
                start_s = free[slot];
            }
            free[slot] += self.took_s();
            if job >= first {
                end_s = end_s.max(free[slot]);
            }
        }
        (start_s, end_s)
    }
}

fn holds(span: Span, time_s: f64) -> bool {
    (span.low_s..=span.high_s).contains(&time_s)
}

/// Shares of ranges that hold the true start and end, and the mean width of the range of the end over its middle.
fn coverage(learned: usize, slots: usize, (ahead, own): (u64, u64), sigma: f64) -> (f64, f64, f64) {
    const REPETITIONS: u64 = 600;
    let (mut starts, mut ends, mut width) = (0, 0, 0.0);
    for repetition in 0..REPETITIONS {
        let random = Rng::with_seed(repetition);
        let mut world = World { random, median: 0.0, sigma, slots };
        // The estimate is wrong by another factor each time.
        world.median = 2.0 * (0.5 * normal(&mut world.random)).exp();
        let speed = Speed::learned((0..learned).map(|_| (world.took_s(), ESTIMATE_S)));
        // Every slot runs a job since some time.
        let running: Vec<(f64, f64)> = (0..slots)
            .map(|_| {
                let (whole_s, done) = (world.took_s(), world.random.f64());
                (whole_s * done, whole_s * (1.0 - done))
            })
            .collect();
        let progressed = |(elapsed_s, left_s): &(f64, f64)| Progressed {
            elapsed_s: *elapsed_s,
            done: Some(elapsed_s / (elapsed_s + left_s)),
            estimate_s: ESTIMATE_S,
            is_own: false,
        };
        let farm = Farm { slots, running: running.iter().map(progressed).collect() };
        let batch = |jobs| Batch { jobs, estimate_s: ESTIMATE_S };
        let queue = Queue { ahead: batch(ahead), between: batch(0), own: batch(own) };
        let spans = forecast(&farm, &queue, &speed, repetition).unwrap();
        let left: Vec<f64> = running.iter().map(|(_, left_s)| *left_s).collect();
        let (start_s, end_s) = world.truth(&left, ahead as usize, (ahead + own) as usize);
        starts += u64::from(holds(spans.start.unwrap(), start_s));
        ends += u64::from(holds(spans.end, end_s));
        width += (spans.end.high_s - spans.end.low_s) / (spans.end.high_s + spans.end.low_s) * 2.0;
    }
    let all = REPETITIONS as f64;
    (starts as f64 / all, ends as f64 / all, width / all)
}

/// Measures rows of the table of `docs/howto/waiting.md`: learned runs, slots, jobs ahead and own jobs, and σ.
fn check_coverage(rows: &[(usize, usize, (u64, u64), f64)]) {
    eprintln!(
        "| learned from | slots | jobs ahead | own jobs | σ | start in range | end in range | width over middle |"
    );
    for &(learned, slots, jobs, sigma) in rows {
        let (starts, ends, width) = coverage(learned, slots, jobs, sigma);
        let (ahead, own) = jobs;
        eprintln!(
            "| {learned} | {slots} | {ahead} | {own} | {sigma} | {:.0} % | {:.0} % | {width:.2} |",
            100.0 * starts,
            100.0 * ends
        );
        for share in [starts, ends] {
            assert!((0.75..=0.85).contains(&share), "{learned} runs, {slots} slots, {jobs:?}: {share}");
        }
    }
}

#[test]
fn forecast_ranges_cover_the_true_times_at_about_the_nominal_rate() {
    check_coverage(&[
        (5, 4, (20, 1), 0.4),
        (20, 4, (20, 1), 0.4),
        (20, 4, (100, 30), 0.4),
        (100, 4, (100, 30), 0.8),
        (100, 16, (300, 100), 0.4),
    ]);
}

#[test]
#[ignore = "half a minute; its figures are in docs/howto/waiting.md"]
fn forecast_ranges_of_a_long_queue_cover_the_true_times() {
    check_coverage(&[(200, 2, (2000, 1500), 0.4)]);
}

#[test]
fn forecast_ranges_narrow_with_more_finished_runs() {
    let width = |learned| coverage(learned, 4, (50, 10), 0.4).2;
    let (few, many) = (width(5), width(100));
    assert!(many < 0.6 * few, "{few} after 5 runs, {many} after 100");
}

#[test]
fn single_outlier_run_hardly_changes_the_learned_speed() {
    let runs = |broken: f64| (0..30).map(move |run| (60.0 + f64::from(run), 60.0)).chain([(broken, 60.0)]);
    let speed = |broken| Speed::learned(runs(broken));
    assert!((speed(60_000.0).median() - speed(70.0).median()).abs() < 0.05);
    assert_eq!(speed(60_000.0).runs(), 31);
    let useless = [(1.0, 0.0), (0.0, 1.0), (f64::NAN, 1.0), (-1.0, 1.0)];
    assert_eq!(Speed::learned(useless).runs(), 0);
}

#[test]
fn without_finished_runs_the_range_is_wide() {
    let farm = Farm { slots: 1, running: Vec::new() };
    let queue = Queue { own: Batch { jobs: 1, estimate_s: 100.0 }, ..Queue::default() };
    let guess = forecast(&farm, &queue, &Speed::learned([]), 1).unwrap();
    assert_eq!(guess.start, Some(Span { low_s: 0.0, high_s: 0.0 }), "a slot is free");
    assert!(guess.end.low_s > 40.0 && guess.end.low_s < 150.0, "{guess:?}");
    assert!(guess.end.high_s > 300.0 && guess.end.high_s < 1200.0, "{guess:?}");
    assert_eq!(forecast(&Farm::default(), &queue, &Speed::learned([]), 1), None, "no slot");
    assert_eq!(
        forecast(&farm, &queue, &Speed::learned([]), 1),
        Some(guess),
        "the same facts, the same forecast"
    );
}

#[test]
fn long_queues_and_large_farms_take_their_share_of_time() {
    // 1,000,000 runs of 100 s each, on 10,000 slots.
    let speed = Speed::learned((0..50).map(|_| (100.0, 100.0)));
    let queue = Queue { own: Batch { jobs: 1_000_000, estimate_s: 100.0 }, ..Queue::default() };
    let spans = forecast(&Farm { slots: 10_000, running: Vec::new() }, &queue, &speed, 1).unwrap();
    assert!(spans.end.low_s > 9_500.0 && spans.end.high_s < 10_700.0, "{spans:?}");
    assert!((spans.work.low_s / 1e8 - 1.0).abs() < 0.05, "{spans:?}");
}

#[test]
fn running_jobs_end_by_their_progress() {
    let running = |done, is_own| Progressed { elapsed_s: 90.0, done, estimate_s: 100.0, is_own };
    let speed = Speed::learned((0..50).map(|_| (100.0, 100.0)));
    let farm = Farm { slots: 1, running: vec![running(Some(0.9), true)] };
    let own = forecast(&farm, &Queue::default(), &speed, 1).unwrap();
    assert_eq!(own.start, None);
    assert!(own.end.low_s > 6.0 && own.end.high_s < 15.0, "{own:?}");
    let farm = Farm { slots: 1, running: vec![running(None, false)] };
    let queue = Queue { own: Batch { jobs: 1, estimate_s: 100.0 }, ..Queue::default() };
    let next = forecast(&farm, &queue, &speed, 1).unwrap();
    assert!(
        (next.start.unwrap().low_s - 10.0).abs() < 1.0 && (next.end.low_s - 110.0).abs() < 1.0,
        "{next:?}"
    );
}
