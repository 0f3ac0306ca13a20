//! The places that a block's flights pass, one after another.

use std::ops::Range;

use pulp::Simd;
#[cfg(target_arch = "x86_64")]
use pulp::bytemuck;

use super::pieces::Id;
use super::touch::{BLOCK, Block, CUBE, Offsets, WIDE};
#[cfg(target_arch = "x86_64")]
use crate::engine::turn::as_v4;

/// Cells of a flight's path that are written down at once.
const AT_ONCE: usize = 16;

/// Cells of a flight's path that are written down without a branch, one by one.
const WITHOUT_BRANCHES: usize = 4;

/// As many as all flights of a block can have.
const MOST: usize = (BLOCK * CUBE + AT_ONCE).next_power_of_two();

/// Passages of a block's flights.
#[derive(Clone, Debug)]
pub struct Passages {
    places: [u32; MOST],
    flights: [Id; MOST],
    count: usize,
}

impl Default for Passages {
    fn default() -> Self {
        Self {
            places: [0; MOST],
            flights: [0; MOST],
            count: 0,
        }
    }
}

impl Passages {
    /// The numbers of the places.
    #[inline(always)]
    pub fn places(&self) -> &[u32] {
        &self.places[..self.count]
    }

    /// Who passes them.
    #[inline(always)]
    pub fn flights(&self) -> &[Id] {
        &self.flights[..self.count]
    }

    /// Makes them those of a block's flights, but for those which `aside` takes by the bits of what they touch.
    #[inline(always)]
    pub fn find<S: Simd>(
        &mut self,
        simd: S,
        block: &Block,
        offsets: &Offsets,
        flights: Range<Id>,
        mut aside: impl FnMut(u32, Id) -> bool,
    ) {
        // Apart from the rest, that it stays in a register.
        let mut count = 0;
        for (id, lane) in flights.zip(0..BLOCK) {
            let touched = block.touched[lane];
            if aside(touched, id) {
                continue;
            }
            let offsets = offsets.of_way(touched);
            let touched = touched & (WIDE - 1);
            count = self.write_down(simd, count, id, block.place[lane], touched, offsets);
        }
        self.count = count;
    }

    /// Writes down those of a flight behind so many others: of each bit that is set its offset from the first place. Gives how many
    /// there are then.
    #[inline(always)]
    fn write_down<S: Simd>(
        &mut self,
        simd: S,
        mut count: usize,
        id: Id,
        first: u32,
        mut touched: u32,
        offsets: &[u32; u32::BITS as usize],
    ) -> usize {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = as_v4(simd) {
            let (halves, _) = offsets.as_chunks::<AT_ONCE>();
            count = self.write_down_some(simd, count, id, first, touched as u16, &halves[0]);
            // Seldom.
            let far = (touched >> AT_ONCE) as u16;
            if far != 0 {
                count = self.write_down_some(simd, count, id, first, far, &halves[1]);
            }
            return count;
        }
        let mut next = |touched: &mut u32| {
            let bit = touched.trailing_zeros() as usize % offsets.len();
            self.places[count % MOST] = first.wrapping_add(offsets[bit]);
            self.flights[count % MOST] = id;
            count += usize::from(*touched != 0);
            *touched &= touched.wrapping_sub(1);
        };
        // How many cells it is cannot be foreseen: most flights are done in so many steps without a branch.
        for _ in 0..WITHOUT_BRANCHES {
            next(&mut touched);
        }
        while touched != 0 {
            next(&mut touched);
        }
        count
    }

    /// Does so for some of them without a branch.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn write_down_some(
        &mut self,
        simd: pulp::x86::V4,
        count: usize,
        id: Id,
        first: u32,
        touched: u16,
        offsets: &[u32; AT_ONCE],
    ) -> usize {
        let avx512f = simd.avx512f;
        let places = avx512f._mm512_add_epi32(
            avx512f._mm512_set1_epi32(first.cast_signed()),
            bytemuck::cast(*offsets),
        );
        let places = avx512f._mm512_maskz_compress_epi32(touched, places);
        let room = count..count + AT_ONCE;
        self.places[room.clone()].copy_from_slice(bytemuck::cast_ref::<_, [u32; AT_ONCE]>(&places));
        self.flights[room].fill(id);
        count + touched.count_ones() as usize
    }
}

#[cfg(test)]
mod tests {
    use pulp::{Arch, Scalar, WithSimd};
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    struct Find<'a>(&'a mut Passages, &'a Block, &'a Offsets);

    impl WithSimd for Find<'_> {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            let Self(passages, block, offsets) = self;
            passages.find(simd, block, offsets, 100..160, |_, id| id % 7 == 0);
        }
    }

    #[test]
    fn places_are_written_down_in_one_order_on_all_machines() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(17);
        let offsets = Offsets::new([144, 12, 1]);
        let mut block = Block::new(0.1);
        let (mut fast, mut plain) = (Passages::default(), Passages::default());
        for likely in [1, 4, 31] {
            for (touched, place) in block.touched.iter_mut().zip(&mut block.place) {
                let bits = (0..u32::BITS).filter(|_| random.random_range(0..32) < likely);
                *touched = bits.fold(0, |bits, bit| bits | 1 << bit);
                *place = random.random_range(1000..2000);
            }
            Arch::new().dispatch(Find(&mut fast, &block, &offsets));
            Find(&mut plain, &block, &offsets).with_simd(Scalar::new());
            assert_eq!(fast.places(), plain.places());
            assert_eq!(fast.flights(), plain.flights());
            let flights = (100..160).zip(block.touched).filter(|(id, _)| id % 7 != 0);
            let count: u32 = flights
                .map(|(_, touched)| (touched & (WIDE - 1)).count_ones())
                .sum();
            assert_eq!(plain.places().len(), count as usize);
            assert!(plain.flights().is_sorted());
        }
    }
}
