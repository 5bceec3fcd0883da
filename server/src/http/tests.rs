//! The table of problems in `api.md` against the one in the code.

use super::problem::Kind;

#[test]
fn api_md_lists_every_kind_of_problem_with_its_status() {
    let text = include_str!("../../../api.md");
    let rows: Vec<_> = text.lines().filter(|line| line.starts_with("| `/problems/")).collect();
    for kind in Kind::ALL {
        let row = format!("| `{}` | {} |", kind.uri(), kind.status().as_u16());
        assert!(rows.iter().any(|line| line.starts_with(&row)), "{row}");
    }
    assert_eq!(rows.len(), Kind::ALL.len());
}
