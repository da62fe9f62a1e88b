//! Codes that weigh bits against error, and a dictionary learned under the same cost.
//!
//! Rows come scaled so that one step of a value is 1 and every Gaussian's error counts the same. A code
//! minimises `|y - D v|^2 + PRICE * bits(v)` over integer values v, greedily.

use crate::support::parallel::map_chunks;
use crate::support::simd::Simd;

/// Squared error, in steps, that a bit may cost. At high rates a quantiser's error falls by
/// 2 ln 2 / 12 = 0.116 squared steps a bit; dead zones and short codes make more of it pay.
pub(super) const PRICE: f32 = 0.16;
/// Entries of per-atom arrays handled together.
const LANES: usize = 16;
/// Rows coded by one task.
pub(super) const CHUNK: usize = 2048;
/// Largest value, in steps; rounding a residual never needs more.
const MAX_VALUE: f32 = 1e6;
/// Atoms taken at most for each value of a row, repeats among them: of rows so long that f32 no longer sees
/// a value being taken there would be no end.
const TAKES_PER_VALUE: usize = 8;
/// Sizes of values whose cost is kept; larger ones are extrapolated.
const VALUE_COSTS: usize = 64;
/// Colour classes told apart in counts: in their cost, and in the contexts they are coded in.
pub(super) const COUNT_CLASSES: usize = 12;
/// Added to every count before a cost is made of it.
const SMOOTHING: f64 = 0.25;

type Lane = [f32; LANES];

/// What symbols cost, in bits.
#[derive(Debug, Clone)]
pub(super) struct Costs {
    /// An atom, by number.
    atoms: Vec<f32>,
    /// A value, by its size minus 1, sign included.
    values: Vec<f32>,
    /// The number of nonzeros, by class and number.
    counts: Vec<Vec<f32>>,
}

impl Costs {
    /// Costs before anything is known.
    pub(super) fn guess(atoms: usize, dim: usize) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let bits = |x: f64| x as f32;
        let value = |k: usize| bits(1.0 + 2.0 * libm::log2((k + 1) as f64) + 1.0);
        let count = |n: usize| bits(0.5 + 0.8 * n as f64);
        Self {
            atoms: vec![bits(libm::log2(atoms as f64)); atoms],
            values: (0..VALUE_COSTS).map(value).collect(),
            counts: vec![(0..=dim + 1).map(count).collect(); COUNT_CLASSES],
        }
    }

    /// Costs from what was used.
    fn of(usage: &Usage, previous: &Self) -> Self {
        let bits = |counts: &[f64]| -> Vec<f32> {
            let total: f64 = counts.iter().map(|c| c + SMOOTHING).sum();
            #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
            let cost = |c: &f64| -libm::log2((c + SMOOTHING) / total) as f32;
            counts.iter().map(cost).collect()
        };
        let mut values = bits(&usage.values);
        values.iter_mut().for_each(|bits| *bits += 1.0);
        let counts = usage
            .counts
            .iter()
            .zip(&previous.counts)
            .map(|(now, before)| if now.iter().sum::<f64>() > 0.0 { bits(now) } else { before.clone() });
        Self { atoms: bits(&usage.atoms), values, counts: counts.collect() }
    }

    fn value(&self, size: f32) -> f32 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1")]
        let index = (size as usize).saturating_sub(1);
        match self.values.get(index) {
            Some(&bits) => bits,
            None => {
                self.values[VALUE_COSTS - 1] + 2.0 * crate::support::maths::log2(size / VALUE_COSTS as f32)
            }
        }
    }
}

/// How often symbols were used.
#[derive(Debug, Clone)]
struct Usage {
    atoms: Vec<f64>,
    values: Vec<f64>,
    counts: Vec<Vec<f64>>,
}

impl Usage {
    fn of(codes: &Codes, classes: &[u8], atoms: usize, dim: usize) -> Self {
        let mut usage = Self {
            atoms: vec![0.0; atoms],
            values: vec![0.0; VALUE_COSTS],
            counts: vec![vec![0.0; dim + 2]; COUNT_CLASSES],
        };
        for (i, &class) in classes.iter().enumerate() {
            let code = codes.row(i);
            usage.counts[usize::from(class).min(COUNT_CLASSES - 1)][code.len()] += 1.0;
            for &(atom, value) in code {
                usage.atoms[usize::from(atom)] += 1.0;
                usage.values[(value.unsigned_abs() as usize - 1).min(VALUE_COSTS - 1)] += 1.0;
            }
        }
        usage
    }
}

/// Codes of many rows, one after the other.
#[derive(Debug, Default, Clone)]
pub(super) struct Codes {
    /// Where each row's code ends.
    ends: Vec<usize>,
    pairs: Vec<(u16, i32)>,
}

impl Codes {
    pub(super) fn row(&self, i: usize) -> &[(u16, i32)] {
        let start = if i == 0 { 0 } else { self.ends[i - 1] };
        &self.pairs[start..self.ends[i]]
    }

    fn push(&mut self, code: &[(u16, i32)]) {
        self.pairs.extend_from_slice(code);
        self.ends.push(self.pairs.len());
    }

    fn append(&mut self, other: &Self) {
        let offset = self.pairs.len();
        self.pairs.extend_from_slice(&other.pairs);
        self.ends.extend(other.ends.iter().map(|end| end + offset));
    }
}

/// A dictionary ready for coding.
#[derive(Debug)]
pub(super) struct Codebook {
    dim: usize,
    blocks: usize,
    /// Row by row the atoms.
    rows: Vec<f32>,
    /// `dim` rows of `blocks` lanes: coefficient d of every atom.
    transposed: Vec<Lane>,
    /// `atoms` rows of `blocks` lanes: products of atoms.
    gram: Vec<Lane>,
    pub(super) costs: Costs,
}

/// Working memory for one row.
struct Scratch {
    correlations: Vec<Lane>,
    prices: Vec<Lane>,
    code: Vec<(u16, f32)>,
}

/// When a code is good enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum StopRule {
    /// More would cost more than it gains.
    Balanced,
    /// The squared error, in steps, is at most this.
    Error(f32),
}

impl Codebook {
    pub(super) fn new(dim: usize, rows: Vec<f32>, costs: Costs) -> Self {
        let atoms = rows.len() / dim.max(1);
        let blocks = atoms.div_ceil(LANES);
        let mut transposed = vec![[0.0; LANES]; dim * blocks];
        let mut gram = vec![[0.0; LANES]; atoms * blocks];
        for (j, atom) in rows.chunks_exact(dim.max(1)).enumerate() {
            for (d, &value) in atom.iter().enumerate() {
                transposed[d * blocks + j / LANES][j % LANES] = value;
            }
        }
        for (j, atom) in rows.chunks_exact(dim.max(1)).enumerate() {
            let products = &mut gram[j * blocks..(j + 1) * blocks];
            for (&value, row) in atom.iter().zip(transposed.chunks_exact(blocks)) {
                for (sum, lane) in products.iter_mut().zip(row) {
                    for i in 0..LANES {
                        sum[i] += value * lane[i];
                    }
                }
            }
        }
        Self { dim, blocks, rows, transposed, gram, costs }
    }

    fn atom(&self, j: usize) -> &[f32] {
        &self.rows[j * self.dim..(j + 1) * self.dim]
    }

    /// Codes of all rows; `classes` has one entry a row.
    pub(super) fn encode(&self, rows: &[f32], classes: &[u8], stop: StopRule) -> Codes {
        let simd = Simd::detect();
        let parts = map_chunks(classes.len(), CHUNK, |range| {
            let mut codes = Codes::default();
            simd.run(Job {
                book: self,
                rows: &rows[range.start * self.dim..range.end * self.dim],
                classes: &classes[range],
                stop,
                codes: &mut codes,
            });
            codes
        });
        let mut all = Codes::default();
        for part in &parts {
            all.append(part);
        }
        all
    }

    fn scratch(&self) -> Scratch {
        let mut prices = vec![[f32::INFINITY; LANES]; self.blocks];
        for (j, bits) in self.costs.atoms.iter().enumerate() {
            prices[j / LANES][j % LANES] = PRICE * bits;
        }
        Scratch { correlations: vec![[0.0; LANES]; self.blocks], prices, code: Vec::new() }
    }

    #[inline(always)]
    fn encode_row(&self, s: &mut Scratch, row: &[f32], class: u8, stop: StopRule, out: &mut Vec<(u16, i32)>) {
        s.code.clear();
        out.clear();
        let mut energy: f32 = row.iter().map(|x| x * x).sum();
        let counts = &self.costs.counts[usize::from(class).min(COUNT_CLASSES - 1)];
        let goal = match stop {
            StopRule::Balanced => 0.0,
            StopRule::Error(most) => most,
        };
        // No code gains more than all the error there is.
        let cheapest = PRICE * (counts[1] - counts[0]).max(0.0);
        if energy <= goal || (stop == StopRule::Balanced && energy <= cheapest) || !energy.is_finite() {
            return;
        }
        s.correlations.fill([0.0; LANES]);
        for (&x, lanes) in row.iter().zip(self.transposed.chunks_exact(self.blocks)) {
            for (sum, lane) in s.correlations.iter_mut().zip(lanes) {
                for i in 0..LANES {
                    sum[i] += x * lane[i];
                }
            }
        }
        for _ in 0..TAKES_PER_VALUE * self.dim {
            if s.code.len() >= self.dim || energy <= goal {
                break;
            }
            let Some(best) = best(&s.correlations, &s.prices) else { break };
            let correlation = s.correlations[best / LANES][best % LANES];
            let value = correlation.round().clamp(-MAX_VALUE, MAX_VALUE);
            let value = if value == 0.0 { 1.0_f32.copysign(correlation) } else { value };
            let gain = value * (2.0 * correlation - value);
            let n = s.code.len();
            let bits = self.costs.atoms[best] + self.costs.value(value.abs()) + counts[n + 1] - counts[n];
            let worth = gain - PRICE * bits;
            if gain <= 0.0 || (stop == StopRule::Balanced && worth <= 0.0) {
                break;
            }
            energy -= gain;
            self.take(s, best, value);
            #[expect(clippy::cast_possible_truncation, reason = "at most 1024 atoms")]
            match s.code.iter_mut().find(|c| usize::from(c.0) == best) {
                Some(pair) => pair.1 += value,
                None => s.code.push((best as u16, value)),
            }
            energy -= self.refine(s);
        }
        if stop == StopRule::Balanced {
            self.drop_costly(s, counts);
        }
        #[expect(clippy::cast_possible_truncation, reason = "clamped to a million")]
        out.extend(s.code.iter().filter(|c| c.1 != 0.0).map(|&(atom, value)| (atom, value as i32)));
        out.sort_by_key(|&(atom, value)| (std::cmp::Reverse(value.unsigned_abs()), atom));
    }

    /// Moves `value` of atom `j` from the residual into the code.
    #[inline(always)]
    fn take(&self, s: &mut Scratch, j: usize, value: f32) {
        let gram = &self.gram[j * self.blocks..(j + 1) * self.blocks];
        for (sum, lane) in s.correlations.iter_mut().zip(gram) {
            for i in 0..LANES {
                sum[i] -= value * lane[i];
            }
        }
    }

    /// Lets every value follow what the later atoms took over. Returns by how much the error fell.
    #[inline(always)]
    fn refine(&self, s: &mut Scratch) -> f32 {
        let mut gained = 0.0;
        for k in 0..s.code.len() {
            let atom = usize::from(s.code[k].0);
            let correlation = s.correlations[atom / LANES][atom % LANES];
            let change = correlation.round();
            if change != 0.0 && change.abs() < MAX_VALUE {
                gained += change * (2.0 * correlation - change);
                self.take(s, atom, change);
                s.code[k].1 += change;
            }
        }
        gained
    }

    /// Drops atoms that turned out to cost more than they are worth.
    #[inline(always)]
    fn drop_costly(&self, s: &mut Scratch, counts: &[f32]) {
        for k in (0..s.code.len()).rev() {
            let (atom, value) = s.code[k];
            let j = usize::from(atom);
            let n = s.code.iter().filter(|c| c.1 != 0.0).count();
            if value == 0.0 || n == 0 {
                continue;
            }
            let loss = value * (value + 2.0 * s.correlations[j / LANES][j % LANES]);
            let bits = self.costs.atoms[j] + self.costs.value(value.abs()) + counts[n] - counts[n - 1];
            if loss < PRICE * bits {
                self.take(s, j, -value);
                s.code[k].1 = 0.0;
            }
        }
    }
}

/// The atom whose correlation's square most exceeds its price, if that and half a step are exceeded.
#[inline(always)]
fn best(correlations: &[Lane], prices: &[Lane]) -> Option<usize> {
    let mut most = [f32::NEG_INFINITY; LANES];
    let mut block = [0_u32; LANES];
    for (number, (c, p)) in (0_u32..).zip(correlations.iter().zip(prices)) {
        for i in 0..LANES {
            let worth = c[i] * c[i] - p[i];
            let better = worth > most[i];
            most[i] = if better { worth } else { most[i] };
            block[i] = if better { number } else { block[i] };
        }
    }
    let mut lane = 0;
    for i in 1..LANES {
        if most[i] > most[lane] {
            lane = i;
        }
    }
    most[lane].is_finite().then(|| block[lane] as usize * LANES + lane)
}

/// The loop of [`Codebook::encode`] as a value, so that it is compiled once for each vector width.
struct Job<'a> {
    book: &'a Codebook,
    rows: &'a [f32],
    classes: &'a [u8],
    stop: StopRule,
    codes: &'a mut Codes,
}

impl pulp::NullaryFnOnce for Job<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let mut scratch = self.book.scratch();
        let mut code = Vec::new();
        for (row, &class) in self.rows.chunks_exact(self.book.dim).zip(self.classes) {
            self.book.encode_row(&mut scratch, row, class, self.stop, &mut code);
            self.codes.push(&code);
        }
    }
}

/// Rounds of coding and refitting.
pub(super) const ROUNDS: usize = 14;
/// An atom with fewer users is replaced.
const MIN_USERS: f64 = 3.0;
/// No atoms are replaced in this many last rounds.
const SETTLING: usize = 4;

/// Learns `atoms` unit-norm atoms from `rows`, first guessed as `first`. Returns them most used first,
/// without those nobody uses, and the costs they were used at.
pub(super) fn learn(
    dim: usize,
    rows: &[f32],
    classes: &[u8],
    first: Vec<f32>,
    stop: StopRule,
    on_round: &mut dyn FnMut(),
) -> (Vec<f32>, Costs) {
    let count = first.len() / dim;
    let mut book = Codebook::new(dim, first, Costs::guess(count, dim));
    for round in 0..ROUNDS {
        let codes = book.encode(rows, classes, stop);
        let usage = Usage::of(&codes, classes, count, dim);
        let mut residuals = rows.to_vec();
        let mut users: Vec<Vec<(u32, f32)>> = vec![Vec::new(); count];
        for (i, residual) in (0_u32..).zip(residuals.chunks_exact_mut(dim)) {
            for &(atom, value) in codes.row(i as usize) {
                #[expect(clippy::cast_precision_loss, reason = "values are small")]
                let value = value as f32;
                users[usize::from(atom)].push((i, value));
                for (r, a) in residual.iter_mut().zip(book.atom(usize::from(atom))) {
                    *r -= value * a;
                }
            }
        }
        let mut atoms = book.rows.clone();
        for (users, atom) in users.iter().zip(atoms.chunks_exact_mut(dim)) {
            refit(users, atom, &mut residuals);
        }
        let costs = Costs::of(&usage, &book.costs);
        if round + SETTLING < ROUNDS {
            replace_unused(dim, &usage.atoms, &mut atoms, &residuals);
        }
        book = Codebook::new(dim, atoms, costs);
        on_round();
    }
    let codes = book.encode(rows, classes, stop);
    let usage = Usage::of(&codes, classes, count, dim);
    let mut order: Vec<usize> = (0..count).filter(|&j| usage.atoms[j] > 0.0).collect();
    order.sort_by(|&a, &b| usage.atoms[b].total_cmp(&usage.atoms[a]).then(a.cmp(&b)));
    if order.is_empty() {
        order.push(0);
    }
    let kept = order.iter().flat_map(|&j| book.atom(j).to_vec()).collect();
    let costs = Costs::of(&usage, &book.costs);
    let atoms = order.iter().map(|&j| costs.atoms[j]).collect();
    (kept, Costs { atoms, ..costs })
}

/// The unit vector that with the users' values leaves the least error (K-SVD's step with values kept).
fn refit(users: &[(u32, f32)], atom: &mut [f32], residuals: &mut [f32]) {
    let dim = atom.len();
    let mut sum = vec![0.0_f64; dim];
    let mut weight = 0.0_f64;
    for &(i, value) in users {
        let residual = &residuals[i as usize * dim..(i as usize + 1) * dim];
        for (s, r) in sum.iter_mut().zip(residual) {
            *s += f64::from(value) * f64::from(*r);
        }
        weight += f64::from(value) * f64::from(value);
    }
    for (s, a) in sum.iter_mut().zip(atom.iter()) {
        *s += weight * f64::from(*a);
    }
    let norm = sum.iter().map(|s| s * s).sum::<f64>().sqrt();
    if norm <= 0.0 || !norm.is_finite() {
        return;
    }
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
    let new: Vec<f32> = sum.iter().map(|s| (s / norm) as f32).collect();
    for &(i, value) in users {
        let residual = &mut residuals[i as usize * dim..(i as usize + 1) * dim];
        for ((r, a), n) in residual.iter_mut().zip(atom.iter()).zip(&new) {
            *r += value * (a - n);
        }
    }
    atom.copy_from_slice(&new);
}

/// Puts the largest residuals where atoms have too few users.
fn replace_unused(dim: usize, users: &[f64], atoms: &mut [f32], residuals: &[f32]) {
    let unused: Vec<usize> = (0..users.len()).filter(|&j| users[j] < MIN_USERS).collect();
    if unused.is_empty() {
        return;
    }
    let energy = |row: &[f32]| row.iter().map(|x| x * x).sum::<f32>();
    let mut order: Vec<(f32, usize)> =
        residuals.chunks_exact(dim).enumerate().map(|(i, row)| (energy(row), i)).collect();
    let wanted = unused.len().min(order.len());
    if wanted == 0 {
        return;
    }
    let by_energy = |a: &(f32, usize), b: &(f32, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
    order.select_nth_unstable_by(wanted - 1, by_energy);
    order.truncate(wanted);
    order.sort_by(by_energy);
    for (&j, &(energy, i)) in unused.iter().zip(&order) {
        if energy > 0.0 {
            let norm = energy.sqrt();
            for (a, r) in atoms[j * dim..(j + 1) * dim].iter_mut().zip(&residuals[i * dim..(i + 1) * dim]) {
                *a = r / norm;
            }
        }
    }
}

/// Each class has two contexts of [`Stream::Count`](super::stream::Stream::Count).
const _: () = assert!(COUNT_CLASSES * 2 <= super::entropy::CONTEXTS);
