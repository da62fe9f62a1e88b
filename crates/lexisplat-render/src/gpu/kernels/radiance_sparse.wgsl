// Sparse codes. They are never expanded to dense SH: each atom is multiplied with the basis, and only three sums are
// kept.
@group(0) @binding(6) var<storage, read> base_colours: array<f32>;
// For every COLUMN_GROUP Gaussians: the word at which their nonzeros begin, and a byte for each Gaussian. The byte is its
// number of nonzeros, or ESCAPED if it is stored exactly. The numbers of the escaped Gaussians follow.
@group(0) @binding(7) var<storage, read> columns: array<u32>;
// For every COLUMN_GROUP Gaussians: their atom numbers, then their values. The exact rows of the escaped Gaussians
// follow, of DIM floats each.
@group(0) @binding(8) var<storage, read> nonzeros: array<u32>;
// The atoms, of ATOM_VECTORS vectors each. In atoms and exact rows the coefficients are in order, with red, green and
// blue of a coefficient side by side.
@group(0) @binding(9) var<storage, read> atoms: array<vec4<f32>>;

struct Column {
    // First word of the group's atom numbers.
    words: u32,
    // Number of words of atom numbers before the values.
    index_words: u32,
    // Number of the group's nonzeros before those of the Gaussian.
    before: u32,
    count: u32,
    escaped: bool,
}

fn sum_of_bytes(word: u32) -> u32 {
    let pairs = (word & 0x00ff00ffu) + ((word >> 8u) & 0x00ff00ffu);
    return (pairs & 0xffffu) + (pairs >> 16u);
}

fn column_of(i: u32) -> Column {
    let base = (i / COLUMN_GROUP) * COLUMN_WORDS;
    let index = i % COLUMN_GROUP;
    var before = 0u;
    var all = 0u;
    var own = 0u;
    for (var w = 0u; w < COLUMN_WORDS - 1u; w++) {
        let word = columns[base + 1u + w];
        let counts = word & 0x7f7f7f7fu;
        all += sum_of_bytes(counts);
        if w < index / 4u {
            before += sum_of_bytes(counts);
        }
        if w == index / 4u {
            let shift = 8u * (index % 4u);
            before += sum_of_bytes(counts & ((1u << shift) - 1u));
            own = (word >> shift) & 0xffu;
        }
    }
    let index_words = (all * INDEX_BYTES + 3u) / 4u;
    return Column(columns[base], index_words, before, own & 0x7fu, (own & ESCAPED) != 0u);
}

fn atom_number(column: Column, k: u32) -> u32 {
    let at = (column.before + k) * INDEX_BYTES;
    let word = nonzeros[column.words + at / 4u];
    return (word >> (8u * (at % 4u))) & INDEX_MASK;
}

fn value_at(column: Column, k: u32) -> f32 {
    let at = column.before + k;
    let first = column.words + column.index_words;
    if VALUE_BYTES == 4u {
        return bitcast<f32>(nonzeros[first + at]);
    }
    let pair = unpack2x16float(nonzeros[first + at / 2u]);
    return select(pair.x, pair.y, at % 2u == 1u);
}

// Returns the index of the exact row of Gaussian `i` of the chunk, by binary search.
fn escape_of(i: u32) -> u32 {
    var low = 0u;
    var high = chunk.escapes;
    while low + 1u < high {
        let middle = (low + high) / 2u;
        if columns[chunk.escapes_at + middle] <= i {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

fn base_colour(i: u32) -> vec3<f32> {
    return vec3<f32>(base_colours[3u * i], base_colours[3u * i + 1u], base_colours[3u * i + 2u]);
}

// Returns the dot products of the three channels of the atom at `at` with the basis.
fn seen(at: u32, b: array<f32, MAX_BASIS>) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    // ATOM_TERMS
    return sum;
}

// Returns the dot products of the three channels of the exact row at `at` with the basis.
fn seen_exact(at: u32, b: array<f32, MAX_BASIS>) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    // EXACT_TERMS
    return sum;
}

// Colours the Gaussian of `slot`, unless `slot` is NO_SLOT. The path defines `look`, which prepares a direction once for
// each Gaussian, and `atom_seen`, which evaluates an atom in that direction.
fn colour_slot(slot: u32) {
    if slot == NO_SLOT {
        return;
    }
    let i = gaussians[slot] - chunk.first;
    let d = direction_to(i);
    let looked = look(d);
    let column = column_of(i);
    var rest = vec3<f32>(0.0);
    for (var k = 0u; k < column.count; k++) {
        rest += value_at(column, k) * atom_seen(atom_number(column, k), looked);
    }
    if column.escaped {
        rest = seen_exact(chunk.exact_at + escape_of(i) * DIM, rest_basis(d));
    }
    write_colour(slot, base_colour(i), rest);
}
