// The draw call of gpu.h.
#include "platform/screen/gpu_internal.h"

static int min_int(int a, int b) { return a < b ? a : b; }
static int max_int(int a, int b) { return a > b ? a : b; }

// Limits drawing to the box and extends the area that the next clear has to cover.
static void set_scissor(struct gpu_target *t, const struct gpu_box *box)
{
    if (!box->width) {
        gpu_target_mark_drawn(t);
        return;
    }
    const int left = max_int(box->left, 0), right = max_int(left, min_int(box->left + box->width, t->width));
    const int top = max_int(box->top, 0), bottom = max_int(top, min_int(box->top + box->height, t->height));
    const bool cleared = t->right <= t->left;
    t->left = cleared ? left : min_int(t->left, left);
    t->top = cleared ? top : min_int(t->top, top);
    t->right = max_int(t->right, right);
    t->bottom = max_int(t->bottom, bottom);
    glEnable(GL_SCISSOR_TEST);
    glScissor(left, top, right - left, bottom - top);
}

void gpu_draw(const struct gpu_job *job)
{
    gpu_make_current(job->target->g);
    job->target->g->counts.draws++;
    assert(!job->depth_test || job->target->kind != GPU_TARGET_COLOR);
    glBindFramebuffer(GL_FRAMEBUFFER, job->target->framebuffer);
    glViewport(0, 0, job->target->width, job->target->height);
    set_scissor(job->target, &job->within);
    glFrontFace(GL_CW); // images have their top row first, which mirrors triangles
    if (job->closed)
        glEnable(GL_CULL_FACE);
    else
        glDisable(GL_CULL_FACE);
    if (job->blend) {
        glEnable(GL_BLEND);
        glBlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
    } else {
        glDisable(GL_BLEND);
    }
    if (job->depth_test) {
        glEnable(GL_DEPTH_TEST);
        glDepthFunc(GL_LESS);
        glDepthMask(!job->no_depth_write);
    } else {
        glDisable(GL_DEPTH_TEST);
    }
    glUseProgram(job->program->id);
    for (int i = 0; i < job->program->sampler_count; i++) {
        glActiveTexture(GL_TEXTURE0 + (GLenum)i);
        glBindTexture(job->textures[i]->layers ? GL_TEXTURE_2D_ARRAY : GL_TEXTURE_2D, job->textures[i]->id);
    }
    glActiveTexture(GL_TEXTURE0);
    glBindVertexArray(job->mesh->array);
    if (job->points)
        glDrawArrays(GL_POINTS, job->first, job->count ? job->count : job->mesh->vertex_count);
    else
        glDrawElements(GL_TRIANGLES, job->count ? job->count : job->mesh->index_count, GL_UNSIGNED_SHORT,
                       (const void *)(sizeof(uint16_t) * (size_t)job->first));
    glBindVertexArray(0);
    glDisable(GL_SCISSOR_TEST);
}
