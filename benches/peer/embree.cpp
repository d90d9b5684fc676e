// Traces dumped rays through dumped triangles with Embree 4, as `cargo bench --bench peer` asks on standard input. The
// answer to a line "ROBUST SET" is the processor seconds of rtcIntersect1, 4, 8 and 16 (of set 1: rtcOccluded), and the
// number of hits.
//
// The declarations are those of Embree's embree4/rtcore.h, so that a wheel without headers is enough.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <vector>

extern "C" {
struct RTCArguments { unsigned flags, features; void *context, *filter, *intersect; float minWidth; };
void *rtcNewDevice(const char *);
void *rtcNewScene(void *);
void rtcSetSceneFlags(void *, unsigned);
void rtcSetSceneBuildQuality(void *, unsigned);
void *rtcNewGeometry(void *, unsigned);
void *rtcSetNewGeometryBuffer(void *, unsigned type, unsigned slot, unsigned format, size_t stride, size_t count);
void rtcCommitGeometry(void *);
unsigned rtcAttachGeometry(void *, void *);
void rtcReleaseGeometry(void *);
void rtcCommitScene(void *);
void rtcIntersect1(void *, void *, RTCArguments *);
void rtcIntersect4(const int *, void *, void *, RTCArguments *);
void rtcIntersect8(const int *, void *, void *, RTCArguments *);
void rtcIntersect16(const int *, void *, void *, RTCArguments *);
void rtcOccluded1(void *, void *, RTCArguments *);
void rtcOccluded4(const int *, void *, void *, RTCArguments *);
void rtcOccluded8(const int *, void *, void *, RTCArguments *);
void rtcOccluded16(const int *, void *, void *, RTCArguments *);
}

constexpr unsigned TRIANGLES = 0, MEDIUM = 1, ROBUST = 1 << 2, INDEX = 0, VERTEX = 1, UINT3 = 0x5003, FLOAT3 = 0x9003;
constexpr unsigned COHERENT = 1 << 16, INVALID = ~0u;

struct Ray { float origin[3], t_min, direction[3], t_max; };

// RTCRayNt and behind it RTCHitNt; the last word is instPrimID, which older versions lack.
template <int N> struct alignas(64) Packet {
    float origin[3][N], near[N], direction[3][N], time[N], far[N];
    unsigned mask[N], id[N], flags[N];
    float normal[3][N], u[N], v[N];
    unsigned triangle[N], geometry[N], instance[N], part[N];
};

static double seconds() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

// Every ray, packets of N; its hits are counted.
template <int N> static double trace(void *scene, const std::vector<Ray> &rays, int set, size_t &hits) {
    const bool any = set == 1;
    RTCArguments arguments{set == 0 ? COHERENT : 0, ~0u, nullptr, nullptr, nullptr, 0};
    const double start = seconds();
    hits = 0;
    for (size_t at = 0; at + N <= rays.size(); at += N) {
        Packet<N> p;
        alignas(64) int valid[N];
        bool some = false;
        for (int k = 0; k < N; k++) {
            const Ray &r = rays[at + k];
            valid[k] = r.t_min <= r.t_max ? -1 : 0;
            some |= valid[k] != 0;
            for (int c = 0; c < 3; c++) {
                p.origin[c][k] = r.origin[c];
                p.direction[c][k] = r.direction[c];
            }
            p.near[k] = r.t_min;
            p.far[k] = r.t_max > 1e37f ? INFINITY : r.t_max;
            p.time[k] = 0;
            p.mask[k] = ~0u;
            p.id[k] = k;
            p.flags[k] = 0;
            p.geometry[k] = p.instance[k] = INVALID;
        }
        if (!some) continue;
        if constexpr (N == 1) any ? rtcOccluded1(scene, &p, &arguments) : rtcIntersect1(scene, &p, &arguments);
        if constexpr (N == 4) (any ? rtcOccluded4 : rtcIntersect4)(valid, scene, &p, &arguments);
        if constexpr (N == 8) (any ? rtcOccluded8 : rtcIntersect8)(valid, scene, &p, &arguments);
        if constexpr (N == 16) (any ? rtcOccluded16 : rtcIntersect16)(valid, scene, &p, &arguments);
        for (int k = 0; k < N; k++) hits += valid[k] && (any ? p.far[k] < 0 : p.geometry[k] != INVALID);
    }
    return seconds() - start;
}

template <class T> static bool read(FILE *file, T *to, size_t count) {
    return fread(to, sizeof(T), count, file) == count;
}

// Squares of 8 x 8, in each squares of 4 x 4: neighbours go together.
static std::vector<Ray> by_squares(const std::vector<Ray> &in, unsigned width, unsigned height) {
    std::vector<Ray> out;
    out.reserve(in.size());
    for (unsigned y = 0; y < height; y += 8)
        for (unsigned x = 0; x < width; x += 8)
            for (unsigned quarter = 0; quarter < 4; quarter++)
                for (unsigned row = 0; row < 4; row++)
                    for (unsigned column = 0; column < 4; column++) {
                        const unsigned j = y + quarter / 2 * 4 + row, i = x + quarter % 2 * 4 + column;
                        if (i < width && j < height) out.push_back(in[size_t(j) * width + i]);
                    }
    return out;
}

int main(int argc, char **argv) {
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : nullptr;
    unsigned size[2], count;
    if (!file || !read(file, size, 2) || !read(file, &count, 1)) return fprintf(stderr, "usage: embree DUMP\n"), 1;
    std::vector<Ray> sets[3];
    for (auto &set : sets) {
        std::vector<Ray> rays(size_t(size[0]) * size[1]);
        if (!read(file, rays.data(), rays.size())) return 1;
        set = by_squares(rays, size[0], size[1]);
    }
    std::vector<float> corners(size_t(count) * 9);
    if (!read(file, corners.data(), corners.size())) return 1;
    fclose(file);
    void *device = rtcNewDevice(""), *scenes[2];
    if (!device) return 1;
    for (unsigned robust = 0; robust < 2; robust++) {
        void *scene = scenes[robust] = rtcNewScene(device);
        rtcSetSceneFlags(scene, robust ? ROBUST : 0);
        rtcSetSceneBuildQuality(scene, MEDIUM);
        void *mesh = rtcNewGeometry(device, TRIANGLES);
        void *vertices = rtcSetNewGeometryBuffer(mesh, VERTEX, 0, FLOAT3, 12, size_t(count) * 3);
        auto *indices = static_cast<unsigned *>(rtcSetNewGeometryBuffer(mesh, INDEX, 0, UINT3, 12, count));
        if (!vertices || !indices) return 1;
        memcpy(vertices, corners.data(), corners.size() * sizeof(float));
        for (unsigned i = 0; i < 3 * count; i++) indices[i] = i;
        rtcCommitGeometry(mesh);
        rtcAttachGeometry(scene, mesh);
        rtcReleaseGeometry(mesh);
        rtcCommitScene(scene);
    }
    int robust, set;
    while (scanf("%d %d", &robust, &set) == 2 && robust >= 0 && robust < 2 && set >= 0 && set < 3) {
        size_t hits = 0;
        void *scene = scenes[robust];
        const double one = trace<1>(scene, sets[set], set, hits), four = trace<4>(scene, sets[set], set, hits),
                     eight = trace<8>(scene, sets[set], set, hits), sixteen = trace<16>(scene, sets[set], set, hits);
        printf("%.9f %.9f %.9f %.9f %zu\n", one, four, eight, sixteen, hits);
        fflush(stdout);
    }
}
