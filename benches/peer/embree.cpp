// Traces dumped rays through dumped triangles with Embree 4: rtcIntersect1, 4, 8 and 16, and of rays that any hit ends
// rtcOccluded.
//
// The declarations are those of Embree's embree4/rtcore.h, so that a wheel without headers is enough.
#include "protocol.h"
#include <cstddef>
#include <cstring>

extern "C" {
struct RTCArguments { unsigned flags, features; void *context, *filter, *intersect; float minWidth; };
void *rtcNewDevice(const char *);
std::ptrdiff_t rtcGetDeviceProperty(void *, unsigned);
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
constexpr unsigned VERSION = 0, COHERENT = 1 << 16, INVALID = ~0u;

// RTCRayNt and behind it RTCHitNt; the last word is instPrimID, which older versions lack.
template <int N> struct alignas(64) Packet {
    float origin[3][N], near[N], direction[3][N], time[N], far[N];
    unsigned mask[N], id[N], flags[N];
    float normal[3][N], u[N], v[N];
    unsigned triangle[N], geometry[N], instance[N], part[N];
};

// Rays in packets of N.
template <int N>
static void trace(void *scene, const peer::Ray *rays, size_t count, peer::Set set, float *distances) {
    const bool any = set == peer::AO;
    RTCArguments arguments{set == peer::PRIMARY ? COHERENT : 0, ~0u, nullptr, nullptr, nullptr, 0};
    for (size_t at = 0; at < count; at += N) {
        Packet<N> p;
        alignas(64) int valid[N];
        bool some = false;
        for (int k = 0; k < N; k++) {
            const peer::Ray &r = rays[at + k];
            valid[k] = r.is_traced() ? -1 : 0;
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
        if (some) {
            if constexpr (N == 1) any ? rtcOccluded1(scene, &p, &arguments) : rtcIntersect1(scene, &p, &arguments);
            if constexpr (N == 4) (any ? rtcOccluded4 : rtcIntersect4)(valid, scene, &p, &arguments);
            if constexpr (N == 8) (any ? rtcOccluded8 : rtcIntersect8)(valid, scene, &p, &arguments);
            if constexpr (N == 16) (any ? rtcOccluded16 : rtcIntersect16)(valid, scene, &p, &arguments);
        }
        for (int k = 0; k < N; k++) {
            const bool hit = valid[k] && (any ? p.far[k] < 0 : p.geometry[k] != INVALID);
            distances[at + k] = !hit ? INFINITY : any ? 0 : p.far[k];
        }
    }
}

template <int N> static peer::Trace with(void *scene) {
    return [scene](const peer::Ray *rays, size_t count, peer::Set set, float *distances) {
        trace<N>(scene, rays, count, set, distances);
    };
}

int main(int argc, char **argv) {
    peer::Dump dump;
    if (argc != 2 || !dump.read(argv[1])) return fprintf(stderr, "usage: embree DUMP\n"), 1;
    void *device = rtcNewDevice("");
    if (!device) return fprintf(stderr, "embree: it makes no device\n"), 1;
    const int version = int(rtcGetDeviceProperty(device, VERSION));
    const std::string name = "Embree " + std::to_string(version / 10000) + "." + std::to_string(version / 100 % 100) +
                             "." + std::to_string(version % 100);
    const unsigned count = dump.triangles();
    std::vector<peer::Column> columns;
    for (bool robust : {true, false}) {
        void *scene = rtcNewScene(device);
        rtcSetSceneFlags(scene, robust ? ROBUST : 0);
        rtcSetSceneBuildQuality(scene, MEDIUM);
        void *mesh = rtcNewGeometry(device, TRIANGLES);
        void *vertices = rtcSetNewGeometryBuffer(mesh, VERTEX, 0, FLOAT3, 12, size_t(count) * 3);
        auto *indices = static_cast<unsigned *>(rtcSetNewGeometryBuffer(mesh, INDEX, 0, UINT3, 12, count));
        if (!vertices || !indices) return fprintf(stderr, "embree: no memory for %u triangles\n", count), 1;
        memcpy(vertices, dump.corners.data(), dump.corners.size() * sizeof(float));
        for (unsigned i = 0; i < 3 * count; i++) indices[i] = i;
        rtcCommitGeometry(mesh);
        rtcAttachGeometry(scene, mesh);
        rtcReleaseGeometry(mesh);
        rtcCommitScene(scene);
        columns.push_back({name + (robust ? " robust" : " not robust"),
                           {{"1", with<1>(scene)}, {"4", with<4>(scene)}, {"8", with<8>(scene)},
                            {"16", with<16>(scene)}}});
    }
    peer::answer(dump, columns);
}
