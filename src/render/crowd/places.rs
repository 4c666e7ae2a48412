//! Which part of the buffer belongs to which rope.

/// Parts of a row of entries that are in use, and those that are not.
#[derive(Debug, Default)]
pub(super) struct Places {
    /// The number of entries up to the last one in use.
    end: u32,
    /// Gaps before it, in ascending order: where, and how long. No two of them touch.
    free: Vec<(u32, u32)>,
}

impl Places {
    /// The number of entries that the row must have.
    pub fn len(&self) -> u32 {
        self.end
    }

    /// Takes `count` consecutive entries, and returns the first of them.
    pub fn take(&mut self, count: u32) -> u32 {
        let Some(gap) = self.free.iter().position(|(_, length)| *length >= count) else {
            self.end += count;
            return self.end - count;
        };
        let (start, length) = &mut self.free[gap];
        let taken = *start;
        (*start, *length) = (*start + count, *length - count);
        if *length == 0 {
            self.free.remove(gap);
        }
        taken
    }

    /// Gives a part back.
    pub fn give_back(&mut self, start: u32, count: u32) {
        let mut gap = self.free.partition_point(|(other, _)| *other < start);
        self.free.insert(gap, (start, count));
        if self.free.get(gap + 1).is_some_and(|(next, _)| *next == start + count) {
            self.free[gap].1 += self.free.remove(gap + 1).1;
        }
        if gap > 0 && self.free[gap - 1].0 + self.free[gap - 1].1 == start {
            self.free[gap - 1].1 += self.free.remove(gap).1;
            gap -= 1;
        }
        let (start, count) = self.free[gap];
        if start + count == self.end {
            self.end = start;
            self.free.remove(gap);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_back_is_taken_again() {
        let mut places = Places::default();
        assert_eq!([5, 3, 4].map(|count| places.take(count)), [0, 5, 8]);
        places.give_back(0, 5);
        places.give_back(5, 3);
        assert_eq!((places.take(8), places.len()), (0, 12));
        places.give_back(0, 8);
        assert_eq!((places.take(2), places.take(7), places.take(6)), (0, 12, 2));
        places.give_back(12, 7);
        assert_eq!(places.len(), 12);
        places.give_back(8, 4);
        places.give_back(0, 2);
        places.give_back(2, 6);
        assert_eq!((places.len(), places.free.len()), (0, 0));
    }
}
