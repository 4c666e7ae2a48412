//! The one counting sort: entries by the number of their bucket, in one flat array.

/// Entries in buckets; those of a bucket keep their order.
#[derive(Debug, Clone)]
pub(super) struct Buckets<T> {
    /// `starts[b]..starts[b + 1]` are the entries of bucket b.
    starts: Vec<u32>,
    entries: Vec<T>,
}

impl<T> Default for Buckets<T> {
    fn default() -> Self {
        Self { starts: Vec::new(), entries: Vec::new() }
    }
}

impl<T: Copy + Default> Buckets<T> {
    /// Sorts `count` buckets full of the entries that `list` hands to its argument; it is called twice.
    pub fn fill(&mut self, count: usize, list: impl Fn(&mut dyn FnMut(usize, T))) {
        let Self { starts, entries } = self;
        starts.clear();
        starts.resize(count + 2, 0);
        // Counted two places further on, so that filling turns the start of each bucket into its end.
        list(&mut |bucket, _| starts[bucket + 2] += 1);
        for bucket in 0..count {
            starts[bucket + 2] += starts[bucket + 1];
        }
        entries.clear();
        entries.resize(starts[count + 1] as usize, T::default());
        list(&mut |bucket, entry| {
            let end = &mut starts[bucket + 1];
            entries[*end as usize] = entry;
            *end += 1;
        });
        starts.pop();
    }

    /// The number of buckets.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The entries of a bucket.
    #[inline]
    pub fn of(&self, bucket: usize) -> &[T] {
        &self.entries[self.starts[bucket] as usize..self.starts[bucket + 1] as usize]
    }

    /// The number of entries in all buckets.
    pub fn entries(&self) -> usize {
        self.entries.len()
    }

    /// Whether no bucket has an entry.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Sorts each bucket and leaves equal entries in it once.
    pub fn sort_and_dedup(&mut self)
    where
        T: Ord,
    {
        let (mut kept, mut start) = (0, 0);
        for bucket in 0..self.len() {
            let end = self.starts[bucket + 1] as usize;
            self.entries[start..end].sort_unstable();
            let first = kept;
            for place in start..end {
                if kept == first || self.entries[kept - 1] != self.entries[place] {
                    self.entries[kept] = self.entries[place];
                    kept += 1;
                }
            }
            self.starts[bucket + 1] = kept as u32;
            start = end;
        }
        self.entries.truncate(kept);
    }
}

/// Sorts entries by a number; those with the same number keep their order. `spare` is working memory.
///
/// Where the numbers are spread far wider than there are entries, comparing takes less than counting.
pub(super) fn sort_by_number<T: Copy>(entries: &mut Vec<T>, spare: &mut Vec<T>, number: impl Fn(&T) -> u32) {
    if entries.is_sorted_by_key(&number) {
        return;
    }
    let (least, most) = entries
        .iter()
        .fold((u32::MAX, 0), |(least, most), entry| (least.min(number(entry)), most.max(number(entry))));
    let range = (most - least) as usize;
    if range > 4 * entries.len() {
        entries.sort_by_key(&number);
        return;
    }
    let mut places = vec![0_u32; range + 1];
    entries.iter().for_each(|entry| places[(number(entry) - least) as usize] += 1);
    let mut next = 0;
    for place in &mut places {
        next += std::mem::replace(place, next);
    }
    spare.clone_from(entries);
    for entry in &*spare {
        let place = &mut places[(number(entry) - least) as usize];
        entries[*place as usize] = *entry;
        *place += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sorting_by_a_number_keeps_the_order_of_equals() {
        for spread in [1, 100_000] {
            let mut entries: Vec<(u32, u32)> = (0..500).map(|at| (at * 7919 % 61 * spread + 5, at)).collect();
            let mut expected = entries.clone();
            expected.sort_unstable();
            sort_by_number(&mut entries, &mut Vec::new(), |(number, _)| *number);
            assert_eq!(entries, expected);
        }
    }

    #[test]
    fn entries_keep_their_order_in_each_bucket() {
        let listed = [(2, 'c'), (0, 'a'), (2, 'b'), (2, 'c'), (0, 'a')];
        let mut buckets = Buckets::default();
        buckets.fill(4, |add| listed.iter().for_each(|(bucket, entry)| add(*bucket, *entry)));
        let all =
            |buckets: &Buckets<char>| (0..4).map(|b| buckets.of(b).iter().collect()).collect::<Vec<String>>();
        assert_eq!(all(&buckets), ["aa", "", "cbc", ""]);
        buckets.sort_and_dedup();
        assert_eq!(all(&buckets), ["a", "", "bc", ""]);
    }
}
