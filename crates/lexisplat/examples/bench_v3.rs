fn main() {
    for path in std::env::args().skip(1) {
        println!("{path}");
        for simd in lexisplat::simd::Simd::available().into_iter().filter(|s| std::env::var("ONLY").map_or(true, |o| o == s.name())) {
            println!("{}", simd.name());
            simd.scope(|| lexisplat::packed::fuzzing::bench(&std::fs::read(&path).unwrap()));
        }
    }
}
