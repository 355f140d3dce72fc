#include "platform/screen/gpu_draw2d.h"

#include "platform/screen/gpu_internal.h"

#include <stdlib.h>

struct gpu_draw2d {
    struct gpu *g;
    struct gpu_program *program;
    GLuint array, vertices, indices, sampler;
    struct gpu_draw2d_view view; // of the current begin .. end
    float map[8];                // the uniform, as last set
};

// ES 3.0 cannot add a base vertex to the indices: the attributes' offsets move instead.
static void set_base_vertex(int first_vertex)
{
    const GLsizei stride = sizeof(struct gpu_draw2d_vertex);
    const size_t base = (size_t)first_vertex * sizeof(struct gpu_draw2d_vertex);
    glVertexAttribPointer(0, 2, GL_FLOAT, GL_FALSE, stride, (void *)(base + offsetof(struct gpu_draw2d_vertex, x)));
    glVertexAttribPointer(1, 2, GL_FLOAT, GL_FALSE, stride, (void *)(base + offsetof(struct gpu_draw2d_vertex, u)));
    glVertexAttribPointer(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, stride,
                          (void *)(base + offsetof(struct gpu_draw2d_vertex, rgba)));
}

enum status gpu_draw2d_open(struct gpu_draw2d **out, struct gpu *gpu, const struct gpu_draw2d_shaders *texts)
{
    static const char *const uniforms[] = {"map"}, *const samplers[] = {"picture"};
    *out = NULL;
    struct gpu_draw2d *f = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "no memory for drawing the screen");
    f->g = gpu;
    const struct gpu_program_source text = {.name = "flat",
                                            .vertex = texts->vertex,
                                            .fragment = texts->fragment,
                                            .uniforms = uniforms,
                                            .uniform_count = 1,
                                            .samplers = samplers,
                                            .sampler_count = 1};
    enum status status = gpu_program_open(&f->program, gpu, &text);
    if (status != OK) {
        free(f);
        return status;
    }
    glGenVertexArrays(1, &f->array);
    glGenBuffers(1, &f->vertices);
    glGenBuffers(1, &f->indices);
    glBindVertexArray(f->array);
    glBindBuffer(GL_ARRAY_BUFFER, f->vertices);
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, f->indices);
    set_base_vertex(0);
    for (GLuint i = 0; i < 3; i++)
        glEnableVertexAttribArray(i);
    glBindVertexArray(0);
    glGenSamplers(1, &f->sampler);
    glSamplerParameteri(f->sampler, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glSamplerParameteri(f->sampler, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glSamplerParameteri(f->sampler, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glSamplerParameteri(f->sampler, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    status = gpu_check(gpu);
    if (status != OK) {
        gpu_draw2d_close(&f);
        return status;
    }
    *out = f;
    return OK;
}

void gpu_draw2d_close(struct gpu_draw2d **out)
{
    struct gpu_draw2d *draw2d = *out;
    if (!draw2d)
        return;
    gpu_program_close(&draw2d->program); // makes the context current
    glDeleteSamplers(1, &draw2d->sampler);
    glDeleteVertexArrays(1, &draw2d->array);
    glDeleteBuffers(1, &draw2d->vertices);
    glDeleteBuffers(1, &draw2d->indices);
    free(draw2d);
    *out = NULL;
}

// ---------------------------------------------------------------- rotation

// From a pixel of the upright image to a pixel of the output, both from the top left.
static void rotate_point(const struct gpu_draw2d_view *view, float x, float y, float *right, float *down)
{
    float w = (float)view->width, h = (float)view->height;
    switch (view->quarter_turns & 3) {
    case 0: *right = x, *down = y; break;
    case 1: *right = h - y, *down = x; break;
    case 2: *right = w - x, *down = h - y; break;
    default: *right = y, *down = w - x; break;
    }
}

static void output_size(const struct gpu_draw2d_view *view, int *width, int *height)
{
    bool across = view->quarter_turns & 1;
    *width = across ? view->height : view->width;
    *height = across ? view->width : view->height;
}

// From upright pixels to clip space. The image's first row is the lowest row of a target in OpenGL's terms, and the
// highest of the window.
static void set_map(struct gpu_draw2d *draw2d)
{
    int width, height;
    float origin[2], along_x[2], along_y[2];
    draw2d->map[3] = draw2d->map[7] = 0; // the texture's share: invalid until set_map_for()
    output_size(&draw2d->view, &width, &height);
    rotate_point(&draw2d->view, 0, 0, &origin[0], &origin[1]);
    rotate_point(&draw2d->view, 1, 0, &along_x[0], &along_x[1]);
    rotate_point(&draw2d->view, 0, 1, &along_y[0], &along_y[1]);
    const float sx = 2 / (float)width, sy = (draw2d->view.target ? 2 : -2) / (float)height;
    for (int row = 0; row < 2; row++) {
        float s = row ? sy : sx;
        draw2d->map[4 * row] = s * (along_x[row] - origin[row]);
        draw2d->map[4 * row + 1] = s * (along_y[row] - origin[row]);
        draw2d->map[4 * row + 2] = s * origin[row] + (row == 1 && !draw2d->view.target ? 1 : -1);
    }
}

// Sets the last entry of each row, the share of the texture in use.
static void set_map_for(struct gpu_draw2d *draw2d, const struct gpu_texture *texture)
{
    const float across = texture->used_width ? (float)texture->used_width / (float)texture->width : 1;
    const float down = texture->used_height ? (float)texture->used_height / (float)texture->height : 1;
    if (draw2d->map[3] == across && draw2d->map[7] == down)
        return;
    draw2d->map[3] = across;
    draw2d->map[7] = down;
    gpu_program_set(draw2d->program, 0, draw2d->map, 2);
}

static void set_clip(const struct gpu_draw2d *draw2d, const struct gpu_draw2d_batch *batch)
{
    int width, height;
    float x0, y0, x1, y1;
    output_size(&draw2d->view, &width, &height);
    rotate_point(&draw2d->view, batch->left, batch->top, &x0, &y0);
    rotate_point(&draw2d->view, batch->right, batch->bottom, &x1, &y1);
    GLint left = (GLint)(x0 < x1 ? x0 : x1), right = (GLint)(x0 < x1 ? x1 : x0);
    GLint top = (GLint)(y0 < y1 ? y0 : y1), bottom = (GLint)(y0 < y1 ? y1 : y0);
    glScissor(left, draw2d->view.target ? top : height - bottom, right - left, bottom - top);
}

// ---------------------------------------------------------------- drawing

void gpu_draw2d_begin(struct gpu_draw2d *draw2d, const struct gpu_draw2d_view *view)
{
    int width, height;
    draw2d->view = *view;
    output_size(view, &width, &height);
    gpu_make_current(draw2d->g);
    glBindFramebuffer(GL_FRAMEBUFFER, view->target ? view->target->framebuffer : 0);
    if (view->target)
        gpu_target_mark_drawn(view->target);
    glViewport(0, 0, width, height);
    glDisable(GL_SCISSOR_TEST);
    if (view->clear) {
        glClearColor(view->clear[0], view->clear[1], view->clear[2], 1);
        glClear(GL_COLOR_BUFFER_BIT);
    }
    set_map(draw2d);
}

void gpu_draw2d_draw(struct gpu_draw2d *draw2d, const struct gpu_draw2d_list *list)
{
    glDisable(GL_CULL_FACE);
    glDisable(GL_DEPTH_TEST);
    glEnable(GL_SCISSOR_TEST);
    glEnable(GL_BLEND);
    glBlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
    glUseProgram(draw2d->program->id);
    glActiveTexture(GL_TEXTURE0);
    glBindSampler(0, draw2d->sampler);
    glBindVertexArray(draw2d->array);
    glBindBuffer(GL_ARRAY_BUFFER, draw2d->vertices);
    glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)sizeof *list->vertices * list->vertex_count, list->vertices,
                 GL_STREAM_DRAW);
    glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)sizeof *list->indices * list->index_count, list->indices,
                 GL_STREAM_DRAW);
    int first_vertex = -1;
    for (int i = 0; i < list->batch_count; i++) {
        const struct gpu_draw2d_batch *batch = &list->batches[i];
        if (batch->right <= batch->left || batch->bottom <= batch->top)
            continue;
        if (batch->first_vertex != first_vertex)
            set_base_vertex(first_vertex = batch->first_vertex);
        set_clip(draw2d, batch);
        set_map_for(draw2d, batch->texture);
        glBindTexture(GL_TEXTURE_2D, batch->texture->id);
        glDrawElements(GL_TRIANGLES, batch->index_count, GL_UNSIGNED_SHORT,
                       (const void *)((size_t)batch->first_index * sizeof *list->indices));
    }
    glBindVertexArray(0);
    glBindSampler(0, 0);
    glDisable(GL_SCISSOR_TEST);
    glDisable(GL_BLEND);
}

enum status gpu_draw2d_end(struct gpu_draw2d *draw2d) { return gpu_check(draw2d->g); }
