//! [`Player`] with AVX2: eight lanes at a time.
//!
//! # Why this module may use `unsafe`
//! AVX2 can load eight numbers from eight places, and offers that by raw pointer alone. Every place is within its list:
//! tables are numbered by [`Lookup`](super::tables::Lookup), which makes the lists that the numbers point into, and places
//! of words are limited to those there are. The safe twins are `Player::take` and `Player::take_bits`; tests compare the
//! two on files and on damaged ones.

use std::arch::x86_64::{
    __m256i, _mm_cvtsi32_si128, _mm256_add_epi32, _mm256_and_si256, _mm256_blendv_epi8, _mm256_castsi256_ps,
    _mm256_cmpeq_epi32, _mm256_cmpgt_epi32, _mm256_i32gather_epi32, _mm256_min_epu32, _mm256_movemask_ps,
    _mm256_mullo_epi32, _mm256_or_si256, _mm256_set1_epi32, _mm256_setr_epi32, _mm256_setzero_si256,
    _mm256_slli_epi32, _mm256_sllv_epi32, _mm256_srl_epi32, _mm256_srli_epi32, _mm256_srlv_epi32,
    _mm256_sub_epi32,
};

use super::player::Player;
use super::streams::{CONTEXTS, Slot};
use super::symbols::{LANES, Lanes};

/// Lanes of a vector, and vectors of all lanes.
const WIDTH: usize = 8;
const HALVES: usize = LANES / WIDTH;

#[inline(always)]
fn load(lanes: &Lanes<u32>, half: usize) -> __m256i {
    bytemuck::cast(lanes.as_chunks::<WIDTH>().0[half])
}

#[inline(always)]
fn store(lanes: &mut Lanes<u32>, half: usize, vector: __m256i) {
    lanes.as_chunks_mut::<WIDTH>().0[half] = bytemuck::cast(vector);
}

/// The next symbol of each lane in `set`.
#[expect(unsafe_code, reason = "AVX2; see the module's documentation")]
#[inline(always)]
pub(super) fn take(
    _: pulp::x86::V3,
    player: &mut Player<'_>,
    slot: Slot,
    context: &Lanes<u32>,
    set: u32,
) -> Lanes<u32> {
    // SAFETY: the first argument exists only on CPUs with AVX2.
    unsafe { take_with(player, slot, context, set) }
}

/// The next `count` raw bits of each lane in `set`, at most 16.
#[expect(unsafe_code, reason = "AVX2; see the module's documentation")]
#[inline(always)]
pub(super) fn take_bits(
    _: pulp::x86::V3,
    player: &mut Player<'_>,
    count: &Lanes<u32>,
    set: u32,
) -> Lanes<u32> {
    // SAFETY: the first argument exists only on CPUs with AVX2.
    unsafe { take_bits_with(player, count, set) }
}

/// All bits of the lanes in `set`.
#[target_feature(enable = "avx2")]
fn mask_of(set: u32) -> __m256i {
    let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(set.cast_signed()), bits), bits)
}

#[expect(unsafe_code, reason = "AVX2; see the module's documentation")]
#[target_feature(enable = "avx2")]
fn take_with(player: &mut Player<'_>, slot: Slot, context: &Lanes<u32>, set: u32) -> Lanes<u32> {
    let (starts, entries) = player.lookup.lists();
    let number = |x: u32| _mm256_set1_epi32(x.cast_signed());
    let precision = slot.stream.precision();
    let shift = _mm_cvtsi32_si128(precision.cast_signed());
    let mut out = [0; LANES];
    for half in 0..HALVES {
        let mask = mask_of(set >> (half * WIDTH));
        let context = _mm256_min_epu32(load(context, half), number(CONTEXTS as u32 - 1));
        let context = _mm256_add_epi32(context, number(slot.number as u32 * CONTEXTS as u32));
        // SAFETY: `starts` has an entry for each context of each stream.
        let start = unsafe { _mm256_i32gather_epi32::<4>(starts.as_ptr().cast(), context) };
        let missing = _mm256_and_si256(_mm256_cmpeq_epi32(start, _mm256_setzero_si256()), mask);
        player.damaged |= _mm256_movemask_ps(_mm256_castsi256_ps(missing)) != 0;
        let states = load(&player.states, half);
        let low = _mm256_and_si256(states, number((1 << precision) - 1));
        // SAFETY: from the start of each table of a stream on there are at least as many entries as its precision says.
        let entry =
            unsafe { _mm256_i32gather_epi32::<4>(entries.as_ptr().cast(), _mm256_add_epi32(start, low)) };
        let share =
            _mm256_add_epi32(_mm256_and_si256(_mm256_srli_epi32::<8>(entry), number(0xfff)), number(1));
        let next = _mm256_mullo_epi32(_mm256_srl_epi32(states, shift), share);
        let next = _mm256_add_epi32(next, _mm256_srli_epi32::<20>(entry));
        refill(player, half, states, next, mask);
        store(&mut out, half, _mm256_and_si256(_mm256_and_si256(entry, number(0xff)), mask));
    }
    out
}

#[target_feature(enable = "avx2")]
fn take_bits_with(player: &mut Player<'_>, count: &Lanes<u32>, set: u32) -> Lanes<u32> {
    let mut out = [0; LANES];
    for half in 0..HALVES {
        let mask = mask_of(set >> (half * WIDTH));
        let count = load(count, half);
        let states = load(&player.states, half);
        let ones = _mm256_sub_epi32(_mm256_sllv_epi32(_mm256_set1_epi32(1), count), _mm256_set1_epi32(1));
        refill(player, half, states, _mm256_srlv_epi32(states, count), mask);
        store(&mut out, half, _mm256_and_si256(_mm256_and_si256(states, ones), mask));
    }
    out
}

/// Takes a word into each of the states `next` that has room for one. Lanes out of `mask` keep `states`.
#[expect(unsafe_code, reason = "AVX2; see the module's documentation")]
#[target_feature(enable = "avx2")]
fn refill(player: &mut Player<'_>, half: usize, states: __m256i, next: __m256i, mask: __m256i) {
    let at = load(&player.next, half);
    // A player has at least two words and at most 2^30.
    let last = _mm256_set1_epi32(player.words.len() as i32 - 1);
    let within = _mm256_min_epu32(at, last);
    // Four bytes of which the word is the upper half: the word before it is always there.
    let before = _mm256_sub_epi32(within, _mm256_set1_epi32(1));
    // SAFETY: `before` is at least 0, since there are two words, and a word follows it.
    let pair = unsafe { _mm256_i32gather_epi32::<2>(player.words.as_ptr().cast(), before) };
    let beyond = _mm256_cmpgt_epi32(at, last);
    let word = _mm256_blendv_epi8(_mm256_srli_epi32::<16>(pair), _mm256_setzero_si256(), beyond);
    let low =
        _mm256_and_si256(_mm256_cmpeq_epi32(_mm256_srli_epi32::<16>(next), _mm256_setzero_si256()), mask);
    let filled = _mm256_or_si256(_mm256_slli_epi32::<16>(next), word);
    let next = _mm256_blendv_epi8(states, next, mask);
    store(&mut player.states, half, _mm256_blendv_epi8(next, filled, low));
    store(&mut player.next, half, _mm256_sub_epi32(at, low));
}
