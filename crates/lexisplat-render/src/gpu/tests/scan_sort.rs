//! Prefix sums, sorting and dispatches in two dimensions by themselves.

#![expect(
    clippy::cast_possible_truncation,
    reason = "tests: small numbers, and failing is their way to tell"
)]

use super::super::capacity::Capacity;
use super::super::constants::{COUNTERS, GROUP, SCAN_BLOCK, SORT_BLOCK};
use super::super::plan::dimensions;
use super::super::shaders::{DRAWING, Kernels, kernels};
use super::super::tests::{Random, gpu};
use super::super::uniforms::FrameUniform;
use super::super::work::Work;
use super::*;

/// The buffers for up to `slots` numbers, and what works on them.
struct Bench {
    gpu: Gpu,
    kernels: Kernels,
    work: Work,
}

impl Bench {
    fn new(gpu: &Gpu, slots: u32) -> Self {
        let capacity = Capacity { blocks: slots, chunks: 0, slots, entries: slots, tiles: 1, pixels: 1 };
        Self {
            gpu: gpu.clone(),
            kernels: gpu.block_on(kernels(gpu, &DRAWING)).unwrap(),
            work: gpu.block_on(Work::new(gpu, capacity, false)).unwrap(),
        }
    }

    fn planner(&self) -> Planner<'_> {
        Planner {
            gpu: &self.gpu,
            kernels: &self.kernels,
            work: &self.work,
            uniforms: Vec::new(),
            steps: Vec::new(),
            passes: Vec::new(),
        }
    }

    fn fill(&self, buffer: &Buffer, words: &[u32]) {
        self.gpu.block_on(self.gpu.write(buffer, 0, bytemuck::cast_slice(words))).unwrap();
    }

    fn run(&self, steps: &[Step]) {
        let mut encoder =
            self.gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        for step in steps {
            pass.set_pipeline(&step.pipeline);
            pass.set_bind_group(0, &step.bindings, &[]);
            match step.size {
                Size::Groups(groups) => {
                    let (x, y) = dimensions(groups);
                    pass.dispatch_workgroups(x, y, 1);
                }
                Size::Indirect(at) => pass.dispatch_workgroups_indirect(&self.work.dispatches.raw, at),
            }
        }
        drop(pass);
        self.gpu.queue().submit([encoder.finish()]);
        self.gpu.wait().unwrap();
    }

    /// A step that makes everything sized by slots work on `count` of them.
    fn count(&self, planner: &mut Planner<'_>, count: u32) {
        let work = &self.work;
        self.fill(&work.starts, &[count]);
        let frame = FrameUniform { slots: work.capacity.slots, ..FrameUniform::default() };
        self.gpu.block_on(self.gpu.write(&work.frame, 0, bytemuck::bytes_of(&frame))).unwrap();
        let bound = [&work.frame, &work.starts, &work.masks, &work.counters, &work.dispatches];
        planner.step(&self.kernels["plan_slots"], all_from(0, bound), Size::Groups(1));
    }
}

#[test]
fn dispatches_cover_all_groups() {
    for groups in [0, 1, MAX_GROUPS, MAX_GROUPS + 1, 3 * MAX_GROUPS, u32::MAX / GROUP] {
        let (x, y) = dimensions(groups);
        assert!(x <= MAX_GROUPS && y <= MAX_GROUPS && u64::from(x) * u64::from(y) >= groups.into());
    }
}

#[test]
fn more_blocks_than_one_dimension_has_get_slots() {
    let Some(gpu) = gpu() else { return };
    let blocks = MAX_GROUPS + 300;
    let bench = Bench::new(&gpu, blocks);
    let words = GROUP / u32::BITS;
    // One Gaussian in most blocks, at an index that varies.
    let marked: Vec<u32> = (0..blocks).filter(|b| b % 7 != 3).map(|b| b * GROUP + b * 31 % GROUP).collect();
    let mut masks = vec![0_u32; (blocks * words) as usize];
    let mut starts = vec![0_u32; blocks as usize];
    for &i in &marked {
        masks[(i / u32::BITS) as usize] |= 1 << (i % u32::BITS);
    }
    for (b, start) in (0..).zip(&mut starts) {
        *start = marked.partition_point(|&i| i < b * GROUP) as u32;
    }
    bench.fill(&bench.work.masks, &masks);
    bench.fill(&bench.work.starts, &starts);
    let frame = FrameUniform { blocks, slots: blocks, ..FrameUniform::default() };
    gpu.block_on(gpu.write(&bench.work.frame, 0, bytemuck::bytes_of(&frame))).unwrap();
    let mut planner = bench.planner();
    let work = &bench.work;
    let bound = [&work.frame, &work.masks, &work.starts, &work.gaussians];
    planner.step(&bench.kernels["compact"], all_from(0, bound), Size::Groups(blocks));
    bench.run(&planner.steps);
    let found: Vec<u32> = gpu.read_back(&work.gaussians);
    assert!(found[..marked.len()] == marked);
}

#[test]
fn scans_are_exclusive_sums() {
    let Some(gpu) = gpu() else { return };
    let most = SCAN_BLOCK * GROUP + 5;
    let bench = Bench::new(&gpu, most);
    let mut random = Random::new(1);
    let lengths =
        [1, 2, GROUP, GROUP + 1, SCAN_BLOCK - 1, SCAN_BLOCK, SCAN_BLOCK + 1, 5 * SCAN_BLOCK + 7, most];
    for length in lengths {
        for fixed in [true, false] {
            let numbers: Vec<u32> = (0..=most).map(|_| (random.unit() * 1000.0) as u32).collect();
            bench.fill(&bench.work.offsets, &numbers);
            let mut planner = bench.planner();
            if fixed {
                planner.scan(&bench.work.offsets, Counter::Found, Some(length), None).unwrap();
            } else {
                // The scan is over one more than there are slots.
                bench.count(&mut planner, length - 1);
                planner
                    .scan(&bench.work.offsets, Counter::SlotsAndEnd, None, Some(Dispatch::SlotScan))
                    .unwrap();
            }
            bench.run(&planner.steps);
            let mut sum = 0;
            let mut expected = numbers.clone();
            for number in expected.iter_mut().take(length as usize) {
                sum += std::mem::replace(number, sum);
            }
            let found: Vec<u32> = bench.gpu.read_back(&bench.work.offsets);
            // Values beyond the length stay as they are.
            assert_eq!(found[..expected.len()], expected, "length {length}, fixed {fixed}");
        }
    }
}

/// More entries than can be counted are too many, not few.
#[test]
fn sums_do_not_wrap_around() {
    let Some(gpu) = gpu() else { return };
    let length = 3 * SCAN_BLOCK + 5;
    let bench = Bench::new(&gpu, length);
    for (number, at) in [(1 << 20, 1), (1 << 31, SCAN_BLOCK), (u32::MAX, 7), (u32::MAX / SCAN_BLOCK, 1)] {
        // Every `at`-th has `number`; the last is none's, and so becomes the sum of all.
        let mut numbers: Vec<u32> = (0..length).map(|i| if i % at == 0 { number } else { 0 }).collect();
        numbers[length as usize - 1] = 0;
        let exact: u64 = numbers.iter().map(|&v| u64::from(v)).sum();
        assert!(exact > u64::from(u32::MAX));
        bench.fill(&bench.work.offsets, &numbers);
        let mut planner = bench.planner();
        planner.scan(&bench.work.offsets, Counter::Found, Some(length), None).unwrap();
        bench.run(&planner.steps);
        let found: Vec<u32> = bench.gpu.read_back(&bench.work.offsets);
        assert_eq!(found[length as usize - 1], u32::MAX, "{number} at every {at}th");
    }
}

#[test]
fn sorts_are_stable() {
    let Some(gpu) = gpu() else { return };
    let most = 9 * SORT_BLOCK + 3;
    let bench = Bench::new(&gpu, most);
    let mut random = Random::new(2);
    let mut bits = || (random.unit() * 65_536.0) as u32 | ((random.unit() * 65_536.0) as u32) << 16;
    for length in [0, 1, 2, GROUP, GROUP + 1, SORT_BLOCK - 1, SORT_BLOCK, SORT_BLOCK + 1, most] {
        for (key_bits, distinct_bits) in [(1, 1), (4, 4), (5, 3), (8, 8), (13, 2), (32, 32), (32, 4)] {
            for identity in [true, false] {
                // Few distinct keys make ties; they use the highest of the bits.
                let keys: Vec<u32> = (0..length)
                    .map(|_| bits() >> (u32::BITS - distinct_bits) << (key_bits - distinct_bits))
                    .collect();
                let values: Vec<u32> = (0..length).map(|i| if identity { i } else { bits() }).collect();
                let work = &bench.work;
                bench.fill(&work.slot_keys[0], &keys);
                let junk = vec![7; length as usize];
                bench.fill(&work.slot_values[0], if identity { &junk } else { &values });
                let mut planner = bench.planner();
                bench.count(&mut planner, length);
                let at = planner
                    .sort(&Sorting {
                        keys: work.slot_keys.each_ref(),
                        values: work.slot_values.each_ref(),
                        bits: key_bits,
                        length: Counter::Slots,
                        blocks: Counter::SlotBlocks,
                        digits: Counter::SlotDigits,
                        groups: Dispatch::SlotBlocks,
                        scan_groups: Dispatch::SlotDigits,
                        identity,
                    })
                    .unwrap();
                assert_eq!(at as u32, key_bits.div_ceil(DIGIT_BITS) % 2);
                bench.run(&planner.steps);
                let mut expected: Vec<(u32, u32)> = keys.into_iter().zip(values).collect();
                expected.sort_by_key(|pair| pair.0);
                let found_keys: Vec<u32> = bench.gpu.read_back(&work.slot_keys[at]);
                let found_values: Vec<u32> = bench.gpu.read_back(&work.slot_values[at]);
                let found: Vec<(u32, u32)> =
                    found_keys.into_iter().zip(found_values).take(length as usize).collect();
                let case =
                    format!("{length} keys of {key_bits} bits, {distinct_bits} of them used, {identity}");
                assert!(found == expected, "{case}");
            }
        }
    }
    let counters: Vec<u32> = bench.gpu.read_back(&bench.work.counters);
    assert!(counters.len() >= COUNTERS && counters[Counter::Slots as usize] == most);
}
