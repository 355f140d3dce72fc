// Lookup of the tags that frames show. Called by the other files of the mapper, calls none of them.
#include "capture/mapping/map_internal.h"

int map_tag_correspondences(const struct map *m, const struct map_frame *f, struct pnp_tag *out)
{
    int count = 0;
    for (int32_t i = 0; i < f->seen_count && count < PNP_MAX_TAGS; i++) {
        const struct map_tag *tag = &m->tags[f->tag_index[i]];
        if (tag->mapped)
            out[count++] = (struct pnp_tag){
                .seen = &f->seen[i],
                .depth = f->depths[i].count ? &f->depths[i] : NULL,
                .world_from_tag = tag->world_from_tag,
                .side_m = tag->side_m,
                .map_px = MAP_TAG_PX,
                .used = true,
            };
    }
    return count;
}

int32_t map_most_observed_tag(const struct map *m, bool mapped)
{
    int32_t best = -1, most = 0;
    for (int32_t t = 0; t < m->tag_count; t++) {
        int32_t count = 0;
        if (mapped && !m->tags[t].mapped)
            continue;
        for (int32_t i = 0; i < m->frame_count; i++)
            for (int32_t k = 0; k < m->frames[i].seen_count; k++)
                count += m->frames[i].tag_index[k] == t;
        if (count > most) {
            most = count;
            best = t;
        }
    }
    return best;
}
