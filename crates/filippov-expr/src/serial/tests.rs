#![allow(clippy::unwrap_used)]

use crate::{ExprError, Graph};

#[test]
fn an_empty_graph_is_24_bytes() {
    let bytes = Graph::new().to_bytes();
    assert_eq!(bytes.len(), 24);
    assert!(Graph::from_bytes(&bytes).unwrap().is_empty());
}

/// A count of four thousand million nodes must not be believed.
#[test]
fn large_counts_allocate_nothing() {
    let bytes = [b"FILEXPR\x02".as_slice(), &u32::MAX.to_le_bytes()].concat();
    assert!(matches!(
        Graph::from_bytes(&bytes),
        Err(ExprError::Damaged {
            offset: 12,
            detail: "ends too early"
        })
    ));
}

#[test]
fn operands_come_before_their_use() {
    let bytes = [
        b"FILEXPR\x02".as_slice(),
        &1_u32.to_le_bytes(),
        &[32],
        &0_u32.to_le_bytes(),
        &[0; 8],
    ]
    .concat();
    assert!(matches!(
        Graph::from_bytes(&bytes),
        Err(ExprError::Damaged { offset: 17, .. })
    ));
}
