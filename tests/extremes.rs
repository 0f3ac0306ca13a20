//! The cheap rows of the matrix of extremes, as everyday tests: the same code that `moltop experiment extremes` runs.

use std::ops::RangeInclusive;

use moltop::experiment::extremes::{Outcome, ROWS, Tier};

/// Rows whose thresholds do not hold today. A row that begins to hold must leave this list.
const FAILING: [u32; 0] = [];

/// Runs the parts of these rows that are of tier A.
#[track_caller]
fn check(numbers: RangeInclusive<u32>) {
    check_tier(Tier::A, numbers);
}

#[track_caller]
fn check_tier(tier: Tier, numbers: RangeInclusive<u32>) {
    let rows = ROWS
        .iter()
        .filter(|row| row.tier == tier && numbers.contains(&row.number));
    let mut unexpected = Vec::new();
    for row in rows {
        let done = row.run();
        println!("{} {}: {:.2} s", row.number, row.title, done.wall_time_s);
        if (done.outcome == Outcome::Fail) != FAILING.contains(&row.number) {
            unexpected.push(format!("row {}: {}", row.number, done.verdict));
        }
    }
    assert!(unexpected.is_empty(), "{}", unexpected.join("\n"));
}

#[test]
fn a_few_balls_do_what_is_known_exactly() {
    check(1..=2);
    check(6..=9);
    check(39..=39);
}

#[test]
fn pairs_are_predicted_as_by_twice_the_precision() {
    check(3..=5);
}

#[test]
fn hardly_any_room_is_enough_and_none_is_an_error() {
    check(10..=11);
    check_tier(Tier::B, 10..=11);
}

#[test]
fn balls_of_very_different_kinds_share_a_box() {
    check_tier(Tier::B, 16..=17);
    check_tier(Tier::B, 34..=34);
}

#[test]
fn units_clocks_and_places_change_nothing() {
    check(12..=15);
}

#[test]
fn rest_corners_and_simultaneous_collisions_are_safe() {
    check(21..=24);
}

#[test]
fn time_runs_back_as_far_as_it_should() {
    check(25..=26);
}

#[test]
fn the_same_gas_has_the_same_bits_and_its_accounts_balance() {
    check(28..=30);
}

#[test]
fn steps_fast_structures_and_slow_twins_agree() {
    check(38..=38);
    check(41..=42);
}

#[test]
fn the_table_has_all_rows_in_order() {
    let mut numbers: Vec<u32> = ROWS.iter().map(|row| row.number).collect();
    assert!(numbers.is_sorted());
    numbers.dedup();
    assert_eq!(numbers, (1..=42).collect::<Vec<_>>());
}
