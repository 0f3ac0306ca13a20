//! A list that is filled anew in every window, in memory that it keeps and has touched.
//!
//! How much a window needs varies by chance. Room is made, and touched, well before a window is the first to need it, so that in
//! a steady gas the process ceases to grow after the first windows.

use std::ops::{Deref, DerefMut};

/// The list.
#[derive(Clone, Debug)]
pub struct Scratch<T> {
    list: Vec<T>,
    /// Entries whose memory has been touched.
    touched: usize,
}

impl<T> Default for Scratch<T> {
    fn default() -> Self {
        Self {
            list: Vec::new(),
            touched: 0,
        }
    }
}

impl<T: Copy> Scratch<T> {
    /// Forgets all entries.
    pub fn empty(&mut self) {
        if self.list.len() > self.touched / 2
            && let Some(&any) = self.list.first()
        {
            // Counts of what happens by chance scatter by the root; what goes together scatters more.
            let spread = 2 * self.list.len().isqrt() + 32;
            if self.list.len() + 2 * spread > self.touched {
                self.touched = self.list.len() + 6 * spread;
                self.list.resize(self.touched, any);
            }
        }
        self.list.clear();
    }
}

impl<T> Deref for Scratch<T> {
    type Target = Vec<T>;

    #[inline(always)]
    fn deref(&self) -> &Vec<T> {
        &self.list
    }
}

impl<T> DerefMut for Scratch<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut Vec<T> {
        &mut self.list
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_that_varies_by_chance_moves_once() {
        let mut scratch = Scratch::default();
        let mut fill = |count: usize| {
            scratch.extend(0..count);
            scratch.empty();
            scratch.capacity()
        };
        let room = fill(1000);
        let mut word = 1_u64;
        for _ in 0..10_000 {
            word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(9);
            assert_eq!(fill(1000 + (word >> 40) as usize % 120), room);
        }
    }
}
