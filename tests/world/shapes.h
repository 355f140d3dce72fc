// The figure's form in the bind frame, as smoothly blended implicit shapes: a signed distance, negative inside.
// Internal to tests/world.
#pragma once
#include "tests/world/body.h"

struct vec3f {
    float x, y, z;
};

enum shape_kind { SHAPE_ROUND_CONE, SHAPE_ELLIPSOID, SHAPE_TUBE }; // a tube has flat ends

struct shape {
    enum shape_kind kind;
    enum bone bone;    // that moves it
    struct vec3f a, b; // its axis; an ellipsoid's centre and radii
    float ra, rb;      // radii at the ends
    float flat;        // depth (y) over width, 1 = round; not for ellipsoids
    float blend;       // width over which it blends with the shapes before it
    bool hangs;        // a skirt or a coat's tail: follows pelvis and thighs
    bool cloth;        // has folds
};

enum { MAX_SHAPES = 96 };

struct form {
    struct shape shapes[MAX_SHAPES];
    int count;
    float scale; // height over 1.75 m
    bool smooth; // without folds
};

struct form form_of(const struct physique *p);

float shape_distance(const struct shape *s, struct vec3f p);

// The shapes that affect the distance at points within `reach` of a middle.
struct shape_subset {
    struct vec3f middle;
    float reach; // 0: not filled yet
    int some[MAX_SHAPES], count;
};

// Makes `n` valid for all points within `need` of p; where it is not yet, it is rebuilt for those within `reach`, >=
// need, of p.
void form_select_shapes(const struct form *f, struct vec3f p, float need, float reach, struct shape_subset *n);

// The distance to all shapes (n NULL) or to the subset.
float form_distance(const struct form *f, struct vec3f p, const struct shape_subset *n);

// The same with the folds of the cloth, good near the surface.
float form_folded(const struct form *f, struct vec3f p, const struct shape_subset *n);

// The outward normal of the folded surface, unit length.
struct vec3f form_normal(const struct form *f, struct vec3f p, const struct shape_subset *n);

// Head and hair, for painting them: relative to the head's joint, for a height of 1.75 m.
struct ellipsoid {
    struct vec3f at, radii;
};
extern const struct ellipsoid head_skull, head_hair, head_long_hair;
float ellipsoid_distance(struct ellipsoid e, struct vec3f p); // approximate, near the surface
