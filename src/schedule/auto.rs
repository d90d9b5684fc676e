//! The schedule `auto`: of the fixed schedules the one that costs least, by measurement, for every kind of pass apart.
//!
//! Each candidate is tried in turn, and the cheapest stays; every so often one of the others has another try, because
//! views change, and measurements err. All schedules find the same hits, so clocks may decide: they change times and
//! counters, never pictures.

use super::Pass;
use crate::settings::Schedule;
use std::collections::BTreeMap;

/// What tries of schedules that are not the cheapest cost in the long run, as a share of the cheapest's cost: one that
/// costs k times as much is tried again after (k - 1) / share passes.
const TRIES_SHARE: f64 = 0.04;
/// Passes between two tries at least.
const TRIES_APART: f64 = 6.0;
/// Weight of the newest measurement of a schedule's cost.
const NEWEST: f64 = 0.5;

/// The schedules that `auto` chooses from.
const ALL: [Schedule; 3] = [Schedule::Chc, Schedule::Demand, Schedule::Plain];

/// What is known of the costs of one kind of pass.
#[derive(Clone, Debug, Default)]
struct Costs {
    /// Milliseconds a ray, loading apart; `None` before the first try.
    of: [Option<f64>; 3],
    /// Passes so far.
    passes: u32,
    /// Passes since a schedule that is not the cheapest was tried.
    since_try: u32,
    /// The schedule of the pass before.
    last: Option<Schedule>,
}

/// Chooses a schedule for every pass.
#[derive(Clone, Debug, Default)]
pub struct Auto {
    kinds: BTreeMap<u32, Costs>,
    /// How often a pass had another schedule than the one of its kind before.
    pub switches: u64,
}

impl Auto {
    /// The schedule for the next pass like `pass`. `is_resident`: everything is resident, so that `plain` may be
    /// chosen; `demand` is then the same as it.
    pub fn choose(&mut self, pass: Pass, is_resident: bool) -> Schedule {
        let costs = self.kinds.entry(kind(pass)).or_default();
        let candidates = if is_resident { [Schedule::Chc, Schedule::Plain] } else { [Schedule::Chc, Schedule::Demand] };
        // The first pass starts with nothing resident: its cost says nothing, and is not noted.
        let chosen = if costs.passes == 0 {
            Schedule::Chc
        } else if let Some(&untried) = candidates.iter().find(|&&fixed| costs.of[fixed as usize].is_none()) {
            untried
        } else {
            let cost = |fixed: Schedule| costs.of[fixed as usize].unwrap_or(f64::INFINITY);
            let [a, b] = candidates;
            let (best, other) = if cost(a) <= cost(b) { (a, b) } else { (b, a) };
            costs.since_try += 1;
            let apart = (cost(other) / cost(best) - 1.0) / TRIES_SHARE;
            if f64::from(costs.since_try) >= apart.max(TRIES_APART) {
                costs.since_try = 0;
                other
            } else {
                best
            }
        };
        self.switches += u64::from(costs.last.is_some_and(|last| last != chosen));
        costs.last = Some(chosen);
        costs.passes += 1;
        chosen
    }

    /// Notes what a pass of the schedule just chosen for it cost: `ms` without loading, for `rays` rays.
    pub fn note(&mut self, pass: Pass, ms: f64, rays: u64) {
        let Some(costs) = self.kinds.get_mut(&kind(pass)) else { return };
        let Some(last) = costs.last.filter(|_| costs.passes > 1 && rays > 0) else { return };
        let cost = ms / rays as f64;
        let known = &mut costs.of[last as usize];
        *known = Some(known.map_or(cost, |known| known + NEWEST * (cost - known)));
    }

    /// How many kinds of passes had each schedule last, by name.
    pub fn in_force(&self) -> [(&'static str, usize); 3] {
        ALL.map(|fixed| (fixed.name(), self.kinds.values().filter(|costs| costs.last == Some(fixed)).count()))
    }
}

/// Passes that are alike: all directions of an effect, all lamps.
fn kind(pass: Pass) -> u32 {
    match pass {
        Pass::Primary => 0,
        Pass::Shadow(_) => 1,
        Pass::Occlusion(_) => 2,
        Pass::Diffuse(_) => 3,
        Pass::Glossy => 4,
        Pass::BounceShadow(_) | Pass::PathShadow(_) => 5,
        Pass::Path(_) => 6,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs `passes` passes whose true costs are given and returns the cost of all over that of the best schedule.
    fn run(auto: &mut Auto, passes: u32, is_resident: bool, cost: impl Fn(Schedule, u32) -> f64) -> f64 {
        let (mut sum, mut best) = (0.0, 0.0);
        for i in 0..passes {
            let chosen = auto.choose(Pass::Primary, is_resident);
            auto.note(Pass::Primary, 1000.0 * cost(chosen, i), 1000);
            sum += cost(chosen, i);
            best += ALL.into_iter().map(|fixed| cost(fixed, i)).fold(f64::INFINITY, f64::min);
        }
        sum / best
    }

    #[test]
    fn the_cheapest_is_found_and_stays() {
        for [chc, demand] in [[1.0, 1.5], [1.5, 1.0], [1.0, 1.0]] {
            let mut auto = Auto::default();
            let cost = |fixed, _| if fixed == Schedule::Chc { chc } else { demand };
            let over = run(&mut auto, 100, false, cost);
            // The first pass and two tries, then a try each 6 passes or (1.5 - 1) / 0.04 = 12.5.
            assert!(over < 1.0 + (2.0 * 0.5 + 8.0 * 0.5) / 100.0 + 1e-9, "{over} times the best");
            assert!(auto.switches <= if chc == demand { 34 } else { 18 }, "{} switches", auto.switches);
        }
    }

    #[test]
    fn a_machine_of_two_speeds_misleads_for_a_few_passes() {
        for (spell, shift) in (1..40).flat_map(|spell| (0..8).map(move |shift| (spell, shift))) {
            let mut auto = Auto::default();
            let cost = |fixed, i: u32| {
                let speed = if ((i + shift) / spell).is_multiple_of(2) { 1.4 } else { 1.0 };
                speed * if fixed == Schedule::Chc { 1.15 } else { 1.0 }
            };
            let over = run(&mut auto, 48, false, cost);
            assert!(over < 1.1, "{over} times the best with spells of {spell}, shifted by {shift}");
        }
    }

    #[test]
    fn a_change_of_view_is_noticed() {
        let mut auto = Auto::default();
        let cost = |fixed, i| if (fixed == Schedule::Chc) == (i < 100) { 1.0 } else { 1.5 };
        run(&mut auto, 100, false, cost);
        let late = run(&mut auto, 100, false, |fixed, i| cost(fixed, i + 100));
        assert!(late < 1.25, "{late} times the best after the change");
        let held = (0..50).filter(|_| auto.choose(Pass::Primary, false) == Schedule::Demand).count();
        assert!(held > 40, "{held} of 50");
    }

    #[test]
    fn plain_needs_everything_resident() {
        let mut auto = Auto::default();
        assert!((0..100).all(|_| {
            let chosen = auto.choose(Pass::Glossy, false);
            auto.note(Pass::Glossy, 1.0, 1);
            chosen != Schedule::Plain
        }));
        run(&mut auto, 20, true, |fixed, _| if fixed == Schedule::Plain { 1.0 } else { 2.0 });
        assert_eq!(auto.choose(Pass::Primary, true), Schedule::Plain);
    }
}
