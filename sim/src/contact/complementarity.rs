//! The linear complementarity problem 0 <= l, b + C l >= 0, l (b + C l) = 0.
//!
//! C is small (one row a contact) and nearly symmetric: block principal pivoting (Judice and Pires 1994)
//! solves it exactly in a few steps, and in finitely many if every principal minor of C is positive. If the columns are
//! too rough for that, projected Gauss-Seidel on the symmetrised matrix gives a usable solution: a wrong multiplier
//! left on a separated pair would spoil all later sweeps.

use crate::functions::positive_part;
use crate::linear::solve as solve_equations;

/// Number of block pivots without progress after which rows are exchanged one at a time.
const PATIENCE: u32 = 3;
/// Smallest diagonal entry to divide by; inaccurate columns may make an entry negative.
const LEAST_DIAGONAL: f64 = 1e-9;
/// Sweeps of projected Gauss-Seidel.
const SWEEPS: usize = 300;

/// Solves the problem for `l`, which holds the initial guess. `matrix`: row by row, with a positive diagonal;
/// `tolerance`: error of b + C l.
pub fn solve(matrix: &[f64], b: &[f64], l: &mut [f64], tolerance: f64) {
    if principal_pivoting(matrix, b, l, tolerance) {
        return;
    }
    let size = b.len();
    let mean: Vec<f64> = (0..size * size).map(|q| 0.5 * (matrix[q] + matrix[(q % size) * size + q / size])).collect();
    gauss_seidel(&mean, b, l, SWEEPS, tolerance);
}

fn row_sum(matrix: &[f64], b: &[f64], l: &[f64], row: usize) -> f64 {
    let size = b.len();
    b[row] + matrix[row * size..(row + 1) * size].iter().zip(l).map(|(c, l)| c * l).sum::<f64>()
}

/// Returns whether the solution was found; if not, `l` is unchanged.
fn principal_pivoting(matrix: &[f64], b: &[f64], l: &mut [f64], tolerance: f64) -> bool {
    let size = b.len();
    let mut active: Vec<bool> =
        (0..size).map(|r| l[r] - row_sum(matrix, b, l, r) / matrix[r * size + r].max(LEAST_DIAGONAL) > 0.0).collect();
    let (mut fewest, mut patience) = (size + 1, PATIENCE);
    let mut next = vec![0.0; size];
    for _ in 0..10 + 4 * size {
        let set: Vec<usize> = (0..size).filter(|&r| active[r]).collect();
        let row = |&r: &usize| -> Vec<f64> { set.iter().map(|&c| matrix[r * size + c]).chain([-b[r]]).collect() };
        let Some(values) = solve_equations(set.iter().map(row).collect()) else {
            return false;
        };
        next.fill(0.0);
        for (&r, value) in set.iter().zip(values) {
            next[r] = value;
        }
        let wrong = |r: &usize| if active[*r] { next[*r] < 0.0 } else { row_sum(matrix, b, &next, *r) <= -tolerance };
        let wrong: Vec<usize> = (0..size).filter(wrong).collect();
        let Some(last) = wrong.last() else {
            l.copy_from_slice(&next);
            return true;
        };
        if wrong.len() < fewest {
            (fewest, patience) = (wrong.len(), PATIENCE);
        } else if patience > 0 {
            patience -= 1;
        } else {
            // With one exchange at a time, no set recurs (Murty 1974).
            active[*last] = !active[*last];
            continue;
        }
        for r in wrong {
            active[r] = !active[r];
        }
    }
    false
}

fn gauss_seidel(matrix: &[f64], b: &[f64], l: &mut [f64], sweeps: usize, tolerance: f64) {
    let size = b.len();
    for _ in 0..sweeps {
        let mut change = 0f64;
        for row in 0..size {
            let diagonal = matrix[row * size + row].max(LEAST_DIAGONAL);
            let value = positive_part(l[row] - row_sum(matrix, b, l, row) / diagonal);
            change = change.max((value - l[row]).abs() * diagonal);
            l[row] = value;
        }
        if change < tolerance {
            break;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn solutions_satisfy_the_law(entries in prop::collection::vec(-1.0f64..1.0, 36), b in prop::collection::vec(-1.0f64..1.0, 6)) {
            // A nearly symmetric matrix with a dominant diagonal, as contacts give.
            let mut matrix = vec![0.0; 36];
            for r in 0..6 {
                for c in 0..6 {
                    matrix[r * 6 + c] = 0.3 * (entries[r * 6 + c] + entries[c * 6 + r]) + 0.02 * entries[r * 6 + c];
                }
                matrix[r * 6 + r] = 4.0;
            }
            let mut l = vec![0.0; 6];
            solve(&matrix, &b, &mut l, 1e-12);
            for r in 0..6 {
                let slack = row_sum(&matrix, &b, &l, r);
                prop_assert!(l[r] >= 0.0 && slack > -1e-9 && (l[r] * slack).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn pivots_that_cycle_end() {
        // From this start, block pivots cycle (the matrix of Murty 1974).
        let matrix = [1.0, 2.0, 0.0, 0.0, 1.0, 2.0, 2.0, 0.0, 1.0];
        let mut l = vec![1.0, 0.0, 0.0];
        assert!(principal_pivoting(&matrix, &[-1.0; 3], &mut l, 1e-12));
        assert!(l.iter().all(|l| (l - 1.0 / 3.0).abs() < 1e-12), "{l:?}");
    }

    proptest! {
        #[test]
        fn a_matrix_that_contacts_cannot_give_ends_in_usable_numbers(entries in prop::collection::vec(-1.0f64..1.0, 16), b in prop::collection::vec(-1.0f64..1.0, 4)) {
            let mut matrix = entries;
            for r in 0..4 {
                matrix[r * 4 + r] = 0.05;
            }
            let mut l = vec![0.5; 4];
            solve(&matrix, &b, &mut l, 1e-9);
            prop_assert!(l.iter().all(|l| *l >= 0.0 && !l.is_nan()), "{l:?}");
        }
    }
}
