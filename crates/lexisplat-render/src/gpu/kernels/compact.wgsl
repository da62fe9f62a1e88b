// Gives a slot to every marked Gaussian. Slots are in the order of the Gaussians.
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> masks: array<u32>;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read_write> gaussians: array<u32>;

@compute @workgroup_size(GROUP)
fn compact(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group_number(group, groups);
    if block >= frame.blocks {
        return;
    }
    let own = lane / 32u;
    let word = masks[block * MASK_WORDS + own];
    let bit = 1u << (lane % 32u);
    if (word & bit) == 0u {
        return;
    }
    var slot = starts[block] + countOneBits(word & (bit - 1u));
    for (var w = 0u; w < own; w++) {
        slot += countOneBits(masks[block * MASK_WORDS + w]);
    }
    if slot < frame.slots {
        gaussians[slot] = block * GROUP + lane;
    }
}
