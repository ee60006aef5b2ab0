//! Numbers.

use rhai::Dynamic;

use super::Words;
use crate::error::{Outcome, fail};
use crate::random::Random;
use crate::values::{number, show};

pub(super) fn teach(words: &mut Words<'_>) {
    mixing(words);
    whole_numbers(words);
    random(words);
}

fn float(given: &Dynamic) -> Outcome<f64> {
    number(given).map_or_else(|| fail(format!("expected a number, found {}", show(given))), Ok)
}

fn mixing(words: &mut Words<'_>) {
    words.word(
        "mix(a: any, b: any, t: number) -> any",
        "Between two numbers, vectors, turns or colours: a at t = 0, b at t = 1. Also called `lerp`.",
        |a: Dynamic, b: Dynamic, t: Dynamic| mix(&a, &b, &t),
    );
    words.form("lerp", |a: Dynamic, b: Dynamic, t: Dynamic| mix(&a, &b, &t));
    words.word("clamp(x: number, low: number, high: number) -> number", "The nearest number within a range.", {
        |x: Dynamic, low: Dynamic, high: Dynamic| -> Outcome<f64> { Ok(float(&x)?.min(float(&high)?).max(float(&low)?)) }
    });
    words.word(
        "smoothstep(low: number, high: number, x: number) -> number",
        "0 below `low`, 1 above `high`, a smooth S between.",
        {
            |low: Dynamic, high: Dynamic, x: Dynamic| -> Outcome<f64> {
                let (low, high) = (float(&low)?, float(&high)?);
                let t = ((float(&x)? - low) / (high - low)).clamp(0.0, 1.0);
                Ok(if t.is_nan() { 0.0 } else { t * t * (3.0 - 2.0 * t) })
            }
        },
    );
    words.word(
        "fract(x: number) -> number",
        "What is behind the point, from 0 to 1 for negative numbers too.",
        |x: Dynamic| -> Outcome<f64> {
            let x = float(&x)?;
            Ok(x - x.floor())
        },
    );
}

fn mix(a: &Dynamic, b: &Dynamic, t: &Dynamic) -> Outcome<f64> {
    let (Some(low), Some(high)) = (number(a), number(b)) else {
        return fail(format!("cannot mix {} with {}", show(a), show(b)));
    };
    let t = float(t)?;
    Ok(low + (high - low) * t)
}

/// The functions of rhai's own packages take numbers with a point; these take whole ones.
fn whole_numbers(words: &mut Words<'_>) {
    words.form("sin", |x: i64| (x as f64).sin()).form("cos", |x: i64| (x as f64).cos()).form("tan", |x: i64| (x as f64).tan());
    words.form("sqrt", |x: i64| (x as f64).sqrt()).form("exp", |x: i64| (x as f64).exp()).form("ln", |x: i64| (x as f64).ln());
    words.form("floor", |x: i64| x).form("ceiling", |x: i64| x).form("round", |x: i64| x);
    words.form("atan", |y: i64, x: i64| (y as f64).atan2(x as f64));
    words.form("min", |a: i64, b: f64| (a as f64).min(b)).form("min", |a: f64, b: i64| a.min(b as f64));
    words.form("max", |a: i64, b: f64| (a as f64).max(b)).form("max", |a: f64, b: i64| a.max(b as f64));
}

fn random(words: &mut Words<'_>) {
    words.engine.register_type_with_name::<Random>("Random");
    words.word("random(seed: int) -> Random", "A sequence of random numbers that is the same in every run.", Random::new);
    words.word("float(random: Random) -> number", "The next number from 0 up to 1: `dice.float()`.", |r: &mut Random| r.unit());
    words.word("float(random: Random, low: number, high: number) -> number", "The next number in a range.", {
        |r: &mut Random, low: Dynamic, high: Dynamic| -> Outcome<f64> {
            let (low, high) = (float(&low)?, float(&high)?);
            Ok(low + (high - low) * r.unit())
        }
    });
    words.word(
        "int(random: Random, low: int, high: int) -> int",
        "The next whole number from `low` to `high`, both included.",
        |r: &mut Random, low: i64, high: i64| r.int(low, high),
    );
    words.form("to_string", |_: &mut Random| "Random").form("to_debug", |_: &mut Random| "Random");
}
