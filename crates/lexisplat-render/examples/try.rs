use lexisplat_render::gpu::*;
use lexisplat_render::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let splats;
    let model;
    let scene = if a[1].ends_with(".ply") {
        splats = lexisplat::ply::read(a[1].as_ref(), &Default::default()).unwrap().splats;
        Scene::from(&splats)
    } else {
        model = lexisplat::lexi::read(a[1].as_ref(), &Default::default()).unwrap();
        Scene::from(&model)
    };
    let cams = if a.len() > 2 && a[2] != "-" {
        read_cameras(&a[2]).unwrap()
    } else {
        orbit(scene.geometry(), 8, 960, 640)
    };
    let step = (cams.len() / 3).max(1);
    for s in adapters() {
        println!("{s:?}");
    }
    let gpu = Gpu::open(GpuChoice::Best).unwrap();
    let mut r = GpuRenderer::new(&gpu).unwrap();
    for path in ShPath::ALL {
        if path.is_sparse() && matches!(scene, Scene::Dense(_)) {
            continue;
        }
        let t = std::time::Instant::now();
        let g = match GpuScene::new(&gpu, &scene, path) {
            Ok(g) => g,
            Err(e) => {
                println!("{e}");
                continue;
            }
        };
        println!(
            "{} uploaded in {:.2}s {:?} {:.1} B/Gaussian chunks",
            path.name(),
            t.elapsed().as_secs_f64(),
            g.bytes(),
            g.bytes().sh as f64 / g.len() as f64
        );
        for c in cams.iter().step_by(step) {
            let c = c.with_max_width(400);
            let t = std::time::Instant::now();
            let cpu = render(&scene, &c, &RenderOptions::default());
            let tc = t.elapsed().as_secs_f64();
            let t = std::time::Instant::now();
            let (img, stats) = r.render(&g, &c, &RenderOptions::default()).unwrap();
            let tg = t.elapsed().as_secs_f64();
            let (mut sum, mut worst, mut over) = (0.0f64, 0.0f32, 0usize);
            for (p, q) in cpu.pixels.iter().zip(&img.pixels) {
                let mut m = 0.0f32;
                for k in 0..3 {
                    let d = p[k].clamp(0.0, 1.0) - q[k].clamp(0.0, 1.0);
                    sum += (d * d) as f64;
                    m = m.max(d.abs());
                }
                worst = worst.max(m);
                if m > 2.0 / 255.0 {
                    over += 1
                }
            }
            let mse = sum / (3 * cpu.pixels.len()) as f64;
            println!(
                "  {} {}x{} psnr {:.2} worst {:.5} over2 {}/{} cpu {:.0}ms gpu {:.0}ms {:?}",
                c.name,
                c.width,
                c.height,
                -10.0 * mse.log10(),
                worst,
                over,
                cpu.pixels.len(),
                tc * 1e3,
                tg * 1e3,
                stats
            );
        }
    }
    println!("bytes {} most {}", gpu.bytes(), gpu.most_bytes());
}
