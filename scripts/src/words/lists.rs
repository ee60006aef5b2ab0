//! Lists made in one go: the way to make the arrays of a mesh.

use rhai::{Array, Dynamic, FnPtr, NativeCallContext};

use super::Words;
use crate::error::{Outcome, fail};

pub(super) fn teach(words: &mut Words<'_>) {
    let limit = words.stage.limits.array_len;
    words.word(
        "each(count: int, make: |i|) -> array",
        "An array of what the function makes of 0, 1, 2, ... Much faster than to push one by one.",
        move |context: NativeCallContext<'_>, count: i64, make: FnPtr| -> Outcome<Array> {
            let count = length(count, 1, limit)?;
            (0..count).map(|i| make.call_within_context::<Dynamic>(&context, (i as i64,))).collect()
        },
    );
    words.form("sort", |context: NativeCallContext<'_>, array: &mut Array, compare: FnPtr| -> Outcome<()> {
        *array = sort(&context, array.clone(), &compare)?;
        Ok(())
    });
    words.word(
        "grid(columns: int, rows: int, make: |u, v|) -> array",
        "An array of what the function makes of the points of a grid over 0 to 1, row by row.",
        move |context: NativeCallContext<'_>, columns: i64, rows: i64, make: FnPtr| -> Outcome<Array> {
            let count = length(columns, rows, limit)?;
            let at = |i: usize, n: i64| if n > 1 { i as f64 / (n - 1) as f64 } else { 0.0 };
            let point = |i: usize| (at(i % columns as usize, columns), at(i / columns as usize, rows));
            (0..count).map(|i| make.call_within_context::<Dynamic>(&context, point(i))).collect()
        },
    );
    words.word(
        "grid_index(columns: int, rows: int) -> array",
        "The triangles between the points of such a grid, as `index` of a Mesh; they face to where rows turn into columns by the right hand.",
        move |columns: i64, rows: i64| -> Outcome<Array> {
            length(columns.saturating_mul(6), rows, limit)?;
            let mut index = Array::new();
            for row in 0..(rows - 1).max(0) {
                for column in 0..(columns - 1).max(0) {
                    let a = row * columns + column;
                    let (b, c, d) = (a + 1, a + columns, a + columns + 1);
                    index.extend([a, c, b, b, c, d].map(Dynamic::from));
                }
            }
            Ok(index)
        },
    );
}

/// Merge sort that ends with the first error; rhai's own goes on comparing, which a script out of time must not.
fn sort(context: &NativeCallContext<'_>, array: Array, compare: &FnPtr) -> Outcome<Array> {
    if array.len() < 2 {
        return Ok(array);
    }
    let mut left = array;
    let right = left.split_off(left.len() / 2);
    let (left, right) = (sort(context, left, compare)?, sort(context, right, compare)?);
    let mut sorted = Array::with_capacity(left.len() + right.len());
    let (mut left, mut right) = (left.into_iter().peekable(), right.into_iter().peekable());
    while let (Some(a), Some(b)) = (left.peek(), right.peek()) {
        let order = compare.call_within_context::<Dynamic>(context, (a.clone(), b.clone()))?;
        let right_first = order.as_int().map_or_else(|_| order.as_bool() == Ok(false), |order| order > 0);
        sorted.extend(if right_first { right.next() } else { left.next() });
    }
    sorted.extend(left);
    sorted.extend(right);
    Ok(sorted)
}

fn length(columns: i64, rows: i64, limit: usize) -> Outcome<usize> {
    let count = columns.checked_mul(rows).filter(|count| columns >= 0 && rows >= 0 && *count as usize <= limit);
    match count {
        Some(count) => Ok(count as usize),
        None => fail(format!("a list has from 0 to {limit} elements, not {columns} x {rows}")),
    }
}
