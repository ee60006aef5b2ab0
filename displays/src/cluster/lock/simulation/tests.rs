//! What must hold.

use super::super::TIMEOUT_US;
use super::faults::{Dice, Faults};
use super::{Pace, Simulation, Tally};

fn run(seed: u64) -> Tally {
    let mut dice = Dice(!seed);
    let faults = Faults {
        lost: [0, 0, 5, 50, 200][dice.below(5) as usize],
        repeated: [0, 20, 300][dice.below(3) as usize],
        longest_us: [300, 3_000, 40_000][dice.below(3) as usize],
        disasters: dice.below(4) > 0,
        together: seed.is_multiple_of(2),
    };
    let displays = 1 + dice.below(7) as usize;
    let pace = Pace {
        first_us: [1_000, 150_000, 1_000_000][dice.below(3) as usize],
        each_us: [1_000, 9_000, 80_000][dice.below(3) as usize],
    };
    let mut simulation = Simulation::new(seed, displays, faults, pace);
    simulation.run_until(4_000_000);
    simulation.now_us = 4_000_000;
    simulation.heal();
    simulation.tally
}

#[test]
fn the_lock_holds_in_every_run() {
    let seeds = std::env::var("UMBRIEL_LOCK_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(300);
    let mut all = Tally::default();
    for seed in 0..seeds {
        println!("seed {seed}");
        let tally = run(seed);
        assert!(tally.shown > 0, "nothing was shown");
        all.steps += tally.steps;
        all.shown += tally.shown;
        all.drops += tally.drops;
        all.fetches += tally.fetches;
        all.diverged += tally.diverged;
        all.restarts += tally.restarts;
        all.forged += tally.forged;
        all.longest_stall_us = all.longest_stall_us.max(tally.longest_stall_us);
        all.longest_rejoin_us = all.longest_rejoin_us.max(tally.longest_rejoin_us);
    }
    println!("{all:?}");
    assert!(all.drops > 0 && all.diverged > 0 && all.restarts > 0 && all.forged > 0, "no fault showed: {all:?}");
}

/// One display of three needs half to one and a half times the timeout for a frame. Each time that it is waited for in vain costs the
/// others the timeout, so that it must become rare.
#[test]
fn a_display_that_is_too_slow_holds_the_others_up_less_and_less() {
    let faults = Faults { lost: 0, repeated: 0, longest_us: 300, disasters: false, together: true };
    let pace = Pace { first_us: 100_000, each_us: 4_000 };
    let too_slow = Pace { first_us: 300_000, each_us: TIMEOUT_US };
    for seed in 0..20 {
        let mut simulation = Simulation::new(seed, 3, faults, pace);
        simulation.slow = Some((1, too_slow));
        let mut drops = Vec::new();
        for end_s in [5, 30, 60] {
            simulation.run_until(end_s * 1_000_000);
            drops.push(simulation.tally.drops);
        }
        assert!(drops[2] - drops[1] <= 4, "seed {seed}: late {drops:?} times by the 5th, 30th and 60th second");
        assert_eq!(simulation.tally.told_slow, 1, "seed {seed}");
        // Once it is as fast as the others, they wait for it again, and it is told of anew when it becomes slow.
        simulation.slow = None;
        simulation.run_until(60_000_000 + 14_000_000);
        assert_eq!(simulation.application.live().count(), 3, "seed {seed}");
        let dropped = simulation.tally.drops;
        simulation.run_until(140_000_000);
        assert_eq!((simulation.tally.drops, simulation.tally.told_slow), (dropped, 1), "seed {seed}");
        simulation.slow = Some((1, too_slow));
        simulation.run_until(170_000_000);
        assert_eq!(simulation.tally.told_slow, 2, "seed {seed}");
    }
}

/// A display that is never fast enough shows what it draws, late, from the first frame on; the operator hears of it, nobody waits for it,
/// and the world is fetched once. Once it is fast enough it is in the lock.
#[test]
fn a_display_that_is_always_too_slow_shows_late_what_it_draws() {
    let faults = Faults { lost: 0, repeated: 0, longest_us: 300, disasters: false, together: true };
    let pace = Pace { first_us: 100_000, each_us: 4_000 };
    let too_slow = Pace { first_us: 4_000_000, each_us: 2 * TIMEOUT_US };
    for (seed, displays) in (0..20).flat_map(|seed| [(seed, 1), (seed, 3)]) {
        let mut simulation = Simulation::new(seed, displays, faults, pace);
        simulation.slow = Some((0, too_slow));
        simulation.run_until(30_000_000);
        let (shown, tally) = (simulation.displays[0].shown, &simulation.tally);
        assert!(shown >= 30, "seed {seed}: {shown} shown");
        assert_eq!((tally.told_slow, tally.fetches, tally.drops), (1, displays as u64, 0), "seed {seed}");
        assert!(tally.longest_stall_us < 60_000, "seed {seed}: a stall of {} us", tally.longest_stall_us);
        simulation.slow = None;
        simulation.run_until(32_000_000);
        assert!(simulation.all_show(), "seed {seed}: {:?}", simulation.application);
        assert_eq!(simulation.tally.fetches, displays as u64, "seed {seed}");
    }
}

/// More frames come while a display draws than are kept: it fetches the world each time, and shows what it has drawn all the same.
#[test]
fn a_display_that_draws_for_very_long_keeps_few_frames() {
    let faults = Faults { lost: 0, repeated: 0, longest_us: 300, disasters: false, together: true };
    let pace = Pace { first_us: 100_000, each_us: 4_000 };
    let very_slow = Pace { first_us: 10_000_000, each_us: 20_000_000 };
    for (seed, displays) in (0..20).flat_map(|seed| [(seed, 1), (seed, 3)]) {
        let mut simulation = Simulation::new(seed, displays, faults, pace);
        simulation.slow = Some((0, very_slow));
        simulation.run_until(300_000_000);
        let (shown, fetches) = (simulation.displays[0].shown, simulation.tally.fetches - (displays as u64 - 1));
        assert!(shown >= 12, "seed {seed}: {shown} shown");
        assert!((shown..=shown + 2).contains(&fetches), "seed {seed}: {shown} shown, {fetches} fetches");
        assert_eq!(simulation.tally.drops, 0, "seed {seed}");
        simulation.slow = None;
        simulation.run_until(340_000_000);
        assert!(simulation.all_show(), "seed {seed}: {:?}", simulation.application);
    }
}

/// Where a frame takes several of the application's, the one that is drawn when the next is published is not waited for as well.
#[test]
fn who_draws_well_within_the_timeout_is_waited_for() {
    let faults = Faults { lost: 0, repeated: 0, longest_us: 300, disasters: false, together: true };
    let pace = Pace { first_us: 1_000_000, each_us: 85_000 };
    for seed in 0..20 {
        let mut simulation = Simulation::new(seed, 1, faults, pace);
        simulation.run_until(3_000_000);
        assert!(simulation.all_show(), "seed {seed}: {:?}", simulation.application);
        simulation.run_until(30_000_000);
        assert_eq!((simulation.tally.drops, simulation.tally.told_slow), (0, 0), "seed {seed}");
    }
}
