// Values that are the same for a whole picture, laid out as `gpu::uniforms::FrameUniform`.
struct Frame {
    // World directions of the camera: rows of the world-to-view rotation.
    right: vec3<f32>,
    // SH degree to evaluate.
    degree: u32,
    down: vec3<f32>,
    // Tiles in a row.
    columns: u32,
    forward: vec3<f32>,
    // Rows of tiles.
    rows: u32,
    position: vec3<f32>,
    // 1 for the anti-aliased rules.
    antialiased: u32,
    background: vec3<f32>,
    // Number of slots for Gaussians that may be visible.
    slots: u32,
    // Tangents of half the field of view.
    tangents: vec2<f32>,
    focal: vec2<f32>,
    size: vec2<f32>,
    // Pixels in a row, and rows.
    width: u32,
    height: u32,
    // Blocks of Gaussians in the scene.
    blocks: u32,
    chunks: u32,
    // Number of entries that the buffers of the tiles' lists hold.
    entries: u32,
    // View-space z beyond which something is drawn.
    near: f32,
}

// A part of the scene that fits in one binding, laid out as `gpu::uniforms::ChunkUniform`.
struct Chunk {
    // Its first Gaussian, a multiple of GROUP, and the number of them.
    first: u32,
    count: u32,
    // Its first block of GROUP Gaussians, and the number of them.
    first_block: u32,
    blocks: u32,
    // Where in `columns` the numbers of its escaped Gaussians begin, and how many there are.
    escapes_at: u32,
    escapes: u32,
    // Where in `nonzeros` their exact rows begin.
    exact_at: u32,
    padding: u32,
}

// Rows of tiles drawn at once, laid out as `gpu::uniforms::Band`.
struct Band {
    first: u32,
    rows: u32,
    tiles: u32,
    padding: u32,
}

// The number of the workgroup. A dispatch has two dimensions where one does not hold all groups.
fn group_number(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.x + group.y * groups.x;
}
