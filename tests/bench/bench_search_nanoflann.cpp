#include "tests/bench/bench_search_nanoflann.h"

#include <nanoflann.hpp>

namespace
{

struct Poses {
    const float *numbers;
    size_t count;
    size_t kdtree_get_point_count() const { return count; }
    float kdtree_get_pt(size_t i, size_t dimension) const { return numbers[i * POSE_NUMBERS + dimension]; }
    template <class Box> bool kdtree_get_bbox(Box &) const { return false; }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Adaptor<float, Poses>, Poses, POSE_NUMBERS, uint32_t>;

} // namespace

struct nanoflann_peer {
    Poses poses;
    Tree tree;
    nanoflann_peer(const float *numbers, size_t count)
        : poses{numbers, count}, tree(POSE_NUMBERS, poses, nanoflann::KDTreeSingleIndexAdaptorParams(10))
    {
        tree.buildIndex();
    }
};

enum status nanoflann_peer_open(struct nanoflann_peer **out, const float *poses, size_t count)
{
    try {
        *out = new nanoflann_peer(poses, count);
        return OK;
    } catch (const std::exception &e) {
        *out = nullptr;
        return fail(ERR_MEMORY, "nanoflann: %s", e.what());
    }
}

void nanoflann_peer_close(struct nanoflann_peer **p)
{
    delete *p;
    *p = nullptr;
}

enum status nanoflann_peer_find(const struct nanoflann_peer *p, const float *pose, size_t *number)
{
    try {
        uint32_t nearest;
        float squared;
        if (!p->tree.knnSearch(pose, 1, &nearest, &squared))
            return NOTHING;
        *number = nearest;
        return OK;
    } catch (const std::exception &e) {
        return fail(ERR_MEMORY, "nanoflann: %s", e.what());
    }
}
