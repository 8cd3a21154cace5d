//! Order of a few items.

/// Sorts a few items by insertion, and leaves the order of equal ones. `comes_before` says whether the first comes before the
/// second.
///
/// The sort of the standard library suits long lists and is six thousand bytes of code for each kind of item, which a page
/// would load.
pub fn sort_few<T>(items: &mut [T], comes_before: impl Fn(&T, &T) -> bool) {
    for end in 1..items.len() {
        let mut place = end;
        while place > 0 && comes_before(&items[place], &items[place - 1]) {
            items.swap(place, place - 1);
            place -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::sort_few;

    #[test]
    fn items_are_in_order_and_equal_ones_stay() {
        let mut items: Vec<(u32, u32)> = (0..40).map(|k| ((17 * k + 5) % 8, k)).collect();
        let mut expected = items.clone();
        expected.sort_by_key(|item| item.0);
        sort_few(&mut items, |a, b| a.0 < b.0);
        assert_eq!(items, expected);
    }
}
