//! Groups of columns of a sparse Jacobian. One finite difference of `f` gives all columns of a group (Curtis, Powell and Reid 1974).
//!
//! No two columns of a group have an entry in the same row. Each column joins the first group in which its rows are still free.

/// Return the groups of columns of a pattern of shape `(n, n)`, row-major. Columns without entries belong to no group.
pub fn column_groups(pattern: &[bool], n: usize) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut taken: Vec<Vec<bool>> = Vec::new();
    for column in 0..n {
        let rows: Vec<usize> = (0..n).filter(|&row| pattern[row * n + column]).collect();
        if rows.is_empty() {
            continue;
        }
        let free = taken.iter().position(|taken| rows.iter().all(|&row| !taken[row]));
        let group = free.unwrap_or_else(|| {
            groups.push(Vec::new());
            taken.push(vec![false; n]);
            groups.len() - 1
        });
        groups[group].push(column);
        for row in rows {
            taken[group][row] = true;
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_a_band_fall_into_three_groups() {
        let n = 8_usize;
        let band: Vec<bool> = (0..n * n).map(|k| (k / n).abs_diff(k % n) <= 1).collect();
        assert_eq!(column_groups(&band, n), [vec![0, 3, 6], vec![1, 4, 7], vec![2, 5]]);
    }

    #[test]
    fn a_full_row_parts_all_columns_and_an_empty_column_is_left_out() {
        let n = 3_usize;
        let mut pattern = vec![true, true, false, false, true, false, false, false, false];
        assert_eq!(column_groups(&pattern, n), [vec![0], vec![1]]);
        pattern.fill(false);
        assert!(column_groups(&pattern, n).is_empty());
        assert!(column_groups(&[], 0).is_empty());
    }
}
