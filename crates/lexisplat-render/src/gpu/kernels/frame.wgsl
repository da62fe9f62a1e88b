// Values that are the same for a whole picture, with the layout of `gpu::uniforms::FrameUniform`.
struct Frame {
    // Directions of the camera in the world: the rows of the world-to-view rotation.
    right: vec3<f32>,
    // SH degree to evaluate.
    degree: u32,
    down: vec3<f32>,
    // Number of tiles in a row.
    columns: u32,
    forward: vec3<f32>,
    // Number of rows of tiles.
    rows: u32,
    position: vec3<f32>,
    // 1 if the rules for anti-aliasing apply, otherwise 0.
    antialiased: u32,
    background: vec3<f32>,
    // Number of slots for Gaussians that may be visible.
    slots: u32,
    // Tangents of half the field of view.
    tangents: vec2<f32>,
    focal: vec2<f32>,
    size: vec2<f32>,
    // Number of pixels in a row, and number of rows.
    width: u32,
    height: u32,
    // Number of blocks of Gaussians in the scene.
    blocks: u32,
    chunks: u32,
    // Number of entries that the buffers of the tile lists hold.
    entries: u32,
    // Near plane: only Gaussians of larger view-space z are drawn.
    near: f32,
}

// A chunk of the scene, which fits in one binding, with the layout of `gpu::uniforms::ChunkUniform`.
struct Chunk {
    // First Gaussian of the chunk, a multiple of GROUP, and number of Gaussians.
    first: u32,
    count: u32,
    // First block of GROUP Gaussians of the chunk, and number of blocks.
    first_block: u32,
    blocks: u32,
    // Offset in `columns` where the numbers of the escaped Gaussians begin, and number of escaped Gaussians.
    escapes_at: u32,
    escapes: u32,
    // Offset in `nonzeros` where the exact rows of the escaped Gaussians begin.
    exact_at: u32,
    padding: u32,
}

// Rows of tiles that are drawn together, with the layout of `gpu::uniforms::Band`.
struct Band {
    first: u32,
    rows: u32,
    tiles: u32,
    padding: u32,
}

// Returns the number of the workgroup. A dispatch has two dimensions if one dimension does not hold all groups.
fn group_number(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.x + group.y * groups.x;
}
