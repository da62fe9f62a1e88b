// The SPZ library of nianticlabs/spz, for formats_beside_peers.py and peers.py.
//
//   spz_reader read FILE.spz OUT.ply       what loadSpz reads, in the axes of a trainer's PLY
//   spz_reader write FILE.ply OUT.spz V [SH1 REST]    FILE in version V, 1 to 4, with so many bits for SH of degree 1
//                                                     and above it, 1 to 8 [default: the library's]
//   spz_reader time FILE.spz ROUNDS        seconds of the fastest loadSpz of the bytes in memory, and the Gaussians
//
// Build: c++ -O3 -std=c++17 -I SPZ/src/cc spz_reader.cpp SPZ/src/cc/*.cc -lz -lzstd -o spz_reader

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include <zlib.h>
#include <zstd.h>

#include "load-spz.h"

static std::vector<uint8_t> bytesOf(const char *path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// The columns of INRIA's PLY, without normals. Opacities may be infinite.
static bool writePly(const spz::GaussianCloud &cloud, const char *path) {
  const size_t count = cloud.numPoints, rest = count ? cloud.sh.size() / count : 0, per = rest / 3;
  std::string head = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(count) + "\n";
  const auto property = [&](const std::string &name) { head += "property float " + name + "\n"; };
  for (const char *name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"}) property(name);
  for (size_t k = 0; k < rest; k++) property("f_rest_" + std::to_string(k));
  for (const char *name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) property(name);
  head += "end_header\n";
  std::ofstream out(path, std::ios::binary);
  out.write(head.data(), head.size());
  std::vector<float> row;
  for (size_t i = 0; i < count; i++) {
    row.clear();
    const auto three = [&](const std::vector<float> &from) { row.insert(row.end(), &from[3 * i], &from[3 * i] + 3); };
    three(cloud.positions);
    three(cloud.colors);
    for (size_t channel = 0; channel < 3; channel++)
      for (size_t k = 0; k < per; k++) row.push_back(cloud.sh[rest * i + 3 * k + channel]);
    row.push_back(cloud.alphas[i]);
    three(cloud.scales);
    const float *turn = &cloud.rotations[4 * i];
    row.insert(row.end(), {turn[3], turn[0], turn[1], turn[2]});
    out.write(reinterpret_cast<const char *>(row.data()), row.size() * sizeof(float));
  }
  return out.good();
}

int main(int count, char **words) {
  const std::string task = count > 1 ? words[1] : "";
  const spz::UnpackOptions toPly{spz::CoordinateSystem::RDF};
  if (task == "versions") {
    printf("zlib %s, zstd %s\n", zlibVersion(), ZSTD_versionString());
    return 0;
  }
  if (task == "read" && count == 4) return writePly(spz::loadSpz(bytesOf(words[2]), toPly), words[3]) ? 0 : 1;
  if (task == "write" && (count == 5 || count == 7)) {
    spz::PackOptions pack;
    pack.version = std::atoi(words[4]);
    pack.from = spz::CoordinateSystem::RDF;
    if (count == 7) {
      pack.sh1Bits = static_cast<uint8_t>(std::atoi(words[5]));
      pack.shRestBits = static_cast<uint8_t>(std::atoi(words[6]));
    }
    return spz::saveSpz(spz::loadSplatFromPly(words[2], toPly), pack, words[3]) ? 0 : 1;
  }
  if (task == "time" && count == 4) {
    const std::vector<uint8_t> bytes = bytesOf(words[2]);
    double best = std::numeric_limits<double>::infinity();
    int read = 0;
    for (int round = 0; round < std::atoi(words[3]); round++) {
      const auto start = std::chrono::steady_clock::now();
      read = spz::loadSpz(bytes, toPly).numPoints;
      best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    }
    printf("%.4f %d\n", best, read);
    return 0;
  }
  fprintf(stderr, "read FILE.spz OUT.ply | write FILE.ply OUT.spz V [SH1 REST] | time FILE.spz ROUNDS | versions\n");
  return 2;
}
