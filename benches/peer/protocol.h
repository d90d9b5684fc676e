// What a program does that `cargo bench --bench peer` measures, but for the tracing. It is started with the path of a
// dump, and on standard output writes a line for each column of the table, its title and its modes between tabs, and
// an empty line. Then it answers lines "MODE SET THREADS" of standard input until that ends. Modes count through all
// columns. An answer is a line "PROCESSOR WALL", seconds, and behind it the distance of every ray as an f32: infinite
// without a hit; of set 1, whose rays any hit ends, 0 with one.
#pragma once
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <string>
#include <thread>
#include <vector>

namespace peer {

// A ray with t_min > t_max is not traced.
struct Ray {
    float origin[3], t_min, direction[3], t_max;
    bool is_traced() const { return t_min <= t_max; }
};

enum Set { PRIMARY, AO, DIFFUSE, SETS };

// Neighbours among the rays are neighbours in the picture: 64 are a square of 8 x 8, and 16 one of 4 x 4.
struct Dump {
    std::vector<Ray> sets[SETS];
    std::vector<float> corners; // nine a triangle

    unsigned triangles() const { return unsigned(corners.size() / 9); }

    bool read(const char *path) {
        FILE *file = fopen(path, "rb");
        if (!file) return false;
        unsigned counts[2];
        bool good = fread(counts, sizeof counts, 1, file) == 1 && counts[0] % 64 == 0;
        for (auto &rays : sets) {
            rays.resize(good ? counts[0] : 0);
            good = good && fread(rays.data(), sizeof(Ray), rays.size(), file) == rays.size();
        }
        corners.resize(good ? size_t(counts[1]) * 9 : 0);
        good = good && fread(corners.data(), sizeof(float), corners.size(), file) == corners.size();
        fclose(file);
        return good;
    }
};

// Traces `count` rays, a multiple of 64, and writes their distances.
using Trace = std::function<void(const Ray *rays, size_t count, Set set, float *distances)>;

struct Column {
    std::string title;
    std::vector<std::pair<std::string, Trace>> modes;
};

inline double processor_seconds() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

// Every thread takes the next block of rays until none is left.
inline void measure(const Trace &trace, const std::vector<Ray> &rays, Set set, unsigned threads) {
    constexpr size_t BLOCK = 4096;
    std::vector<float> distances(rays.size());
    std::vector<double> processor(threads);
    std::atomic<size_t> next{0};
    auto work = [&](unsigned thread) {
        const double start = processor_seconds();
        for (size_t at; (at = next.fetch_add(BLOCK)) < rays.size();)
            trace(&rays[at], std::min(BLOCK, rays.size() - at), set, &distances[at]);
        processor[thread] = processor_seconds() - start;
    };
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::thread> others;
    for (unsigned thread = 1; thread < threads; thread++) others.emplace_back(work, thread);
    work(0);
    for (auto &thread : others) thread.join();
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
    double all = 0;
    for (double one : processor) all += one;
    printf("%.9f %.9f\n", all, wall.count());
    fwrite(distances.data(), sizeof(float), distances.size(), stdout);
    fflush(stdout);
}

inline void answer(const Dump &dump, const std::vector<Column> &columns) {
    std::vector<Trace> modes;
    for (const auto &column : columns) {
        printf("%s", column.title.c_str());
        for (const auto &[name, trace] : column.modes) {
            printf("\t%s", name.c_str());
            modes.push_back(trace);
        }
        printf("\n");
    }
    printf("\n");
    fflush(stdout);
    unsigned mode, set, threads;
    while (scanf("%u %u %u", &mode, &set, &threads) == 3 && mode < modes.size() && set < SETS && threads > 0)
        measure(modes[mode], dump.sets[set], Set(set), threads);
}

} // namespace peer
