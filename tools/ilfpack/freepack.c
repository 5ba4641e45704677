/*
 * freepack.c - see freepack.h.
 */
#include "freepack.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "base/outfile.h"
#include "freereport.h"
#include "gaps.h"
#include "headings.h"
#include "ilflamps/blobs.h"
#include "ilflamps/compose.h"
#include "ilflamps/rounding.h"
#include "ilflamps/taken.h"
#include "regrid.h"

#include "support.h"

enum { MOST_LAMPS = 32 };
#define BRIGHT    15.                      /* times the typical luminance: a lamp */
#define MAX_WIDTH (15 / 57.29577951308232) /* lamps that look wider stay in the field, radians */
#define WRONG     .1  /* log luminance: pictures that disagree so much are not where the file has them */
#define STRANGE   .02 /* log luminance: a picture that disagrees more is said */
#define FAR       1.5 /* mean distances between pictures: a node beyond is said */

typedef struct job {
    const freeplan *p;
    char **pictures;
    int n;
    places at; /* in the pictures' order */
    double plane[9];
    ilf_frame frame;
    int n_u, n_v;
    shotfacts facts;
    headings headings;
    refined poses;
    analysis a;
    reach *nodes;
} job;

/* ---- before any picture --------------------------------------------------------------------------- */

static int take_pictures(job *j, char *const *pictures, int n, errmsg *e)
{
    if (!n) {
        j->n = j->at.n;
        return places_names(&j->pictures, &j->at, j->p->positions, e);
    }
    j->n = n, j->pictures = calloc((size_t)n + 1, sizeof *j->pictures);
    for (int k = 0; j->pictures && k < n; k++)
        if (!(j->pictures[k] = strdup(pictures[k]))) return err_set(e, "no memory for names");
    return j->pictures ? places_match(&j->at, pictures, n, j->p->positions, e)
                       : err_set(e, "no memory for names");
}

static int take_plane(job *j, errmsg *e)
{
    ilf_error err;

    if (j->p->plane) memcpy(j->plane, j->p->plane, sizeof j->plane);
    else if (support_plane(j->plane, j->at.p, j->n, j->p->positions, e)) return -1;
    if (ilf_frame_init(&j->frame, j->plane, j->plane + 3, j->plane + 6, NULL, &err) != ILF_OK)
        return err_set(e, "--plane: %s", err.text);
    support_grid(&j->n_u, &j->n_v, &j->frame, j->n);
    if (j->p->n_u) j->n_u = j->p->n_u, j->n_v = j->p->n_v;
    support_order(j->at.p, j->pictures, j->n, &j->frame);
    return 0;
}

static int job_make(job *j, const freeplan *p, char *const *pictures, int n, errmsg *e)
{
    memset(j, 0, sizeof *j);
    j->p = p;
    return places_read(&j->at, p->positions, e) || take_pictures(j, pictures, n, e) || take_plane(j, e) ? -1
                                                                                                        : 0;
}

static void job_free(job *j)
{
    for (int k = 0; j->pictures && k < j->n; k++) free(j->pictures[k]);
    free(j->pictures), free(j->nodes);
    refined_free(&j->poses);
    places_free(&j->at);
    if (j->a.lamps) analysis_free(&j->a);
}

int freepack_check(const freeplan *p, char *const *pictures, int n, errmsg *e)
{
    job j;
    const int bad = job_make(&j, p, pictures, n, e);

    job_free(&j);
    return bad;
}

/* ---- the work ------------------------------------------------------------------------------------- */

static int load(job *j, lightfield *f, errmsg *e)
{
    return shots_load(f, &j->facts, j->pictures, j->at.p, j->n, &j->frame, &j->p->how, e);
}

/* What pictures did not see, from those that did. */
static int fill_gaps(job *j, lightfield *f, errmsg *e)
{
    surroundings around = {0};
    double part;

    if (!f->unseen) return 0;
    if (j->p->octree ? surroundings_from(&around, j->p->octree, f, e) : surroundings_guess(&around, f, e))
        return -1;
    const int bad = gaps_fill(&part, f, &around, BRIGHT * blobs_typical(f), e);
    surroundings_free(&around);
    if (!bad)
        cli_note("holes are filled from other pictures that saw the same place of the surroundings (%.3g %% "
                 "of them)%s",
                 100 * part, part < 1 ? ", else from around them" : "");
    return bad;
}

static int find_lamps(job *j, lightfield *f, errmsg *e)
{
    const plan p = {.most = MOST_LAMPS, .max_width = MAX_WIDTH, .octree = j->p->octree};

    if (analyse_field(&j->a, f, &p, e)) return -1;
    taken_first(&j->a);
    return 0;
}

/* The grid takes the pictures' place in the analysis; what single pictures measured of the lamps is no
 * node's. */
static int to_grid(job *j, errmsg *e)
{
    analysis *a = &j->a;
    const int rows = (int)lround(3.14159265358979323846 / 2 / a->f.dp);
    lightfield g;

    if (regrid(&g, &a->f, &a->around, j->n_u, j->n_v, a->f.nt, rows > 1 ? rows : 1, e)) return -1;
    lf_free(&a->f);
    a->f = g;
    for (int i = 0; i < a->n; i++) {
        double *none = malloc((size_t)g.n * sizeof *none);
        if (!none) return err_set(e, "no memory for lamps");
        for (int k = 0; k < g.n; k++) none[k] = -1;
        free(a->lamps[i].l.seen);
        a->lamps[i].l.seen = none;
    }
    return 0;
}

static ilf_spec spec_of(const job *j, ilf_loss *loss)
{
    ilf_spec spec = lf_spec(&j->a.f);

    memcpy(spec.origin, j->plane, sizeof spec.origin);
    memcpy(spec.U, j->plane + 3, sizeof spec.U), memcpy(spec.V, j->plane + 6, sizeof spec.V);
    spec.type = j->p->type, spec.compression = j->p->compression, spec.interleave = j->p->interleave;
    spec.comments = j->p->line, spec.name = j->p->target;
    spec.owner = j->facts.owner[0] ? j->facts.owner : NULL;
    spec.cap_date = j->facts.cap_date[0] ? j->facts.cap_date : NULL;
    spec.white_luminance = j->facts.white_luminance;
    spec.tolerance = j->p->tolerance, spec.loss = loss;
    return spec;
}

static int write_field(const job *j, ilf_spec spec, errmsg *e)
{
    ilf_luminaire *lamps = taken_lamps(&spec.n_lamps, &j->a);
    outfile *o = NULL;
    int bad = lamps ? 0 : err_set(e, "no memory for lamps");

    for (int k = 0; !bad && k < spec.n_lamps; k++) free(lamps[k].seen), lamps[k].seen = NULL;
    spec.lamps = lamps;
    if (!bad) bad = out_begin(&o, j->p->target, e);
    if (!bad && lf_write_as(&j->a.f, out_path(o), &spec, e)) {
        out_abort(o);
        bad = -1;
    } else if (!bad) bad = out_commit(o, e);
    taken_free(lamps, spec.n_lamps);
    return bad;
}

static int write_out(const job *j, errmsg *e)
{
    ilf_loss loss = {0};
    const ilf_spec spec = spec_of(j, &loss);
    const int bad =
        j->p->keep_lamps ? compose_write_as(j->p->target, &j->a, &spec, e) : write_field(j, spec, e);

    if (!bad && spec.tolerance > 0) rounding_say(&loss, j->p->target, !j->p->keep_lamps);
    return bad;
}

/* ---- words ---------------------------------------------------------------------------------------- */

static void say_plan(const job *j)
{
    const double *p = j->plane;

    if (!j->p->plane)
        cli_note("%s: no --plane: origin %.6g %.6g %.6g, U %.6g 0 0, V 0 %.6g 0, the rectangle about the "
                 "positions at "
                 "their mean height",
                 j->p->positions, p[0], p[1], p[2], p[3], p[7]);
    if (!j->p->n_u)
        cli_note("%s: no --grid: %dx%d, as many nodes as pictures", j->p->positions, j->n_u, j->n_v);
    if (j->at.n > j->n)
        cli_note("%s: %d lines name none of the pictures given (the first: line %d, %s)", j->p->positions,
                 j->at.n - j->n, j->at.p[j->n].line, j->at.p[j->n].name);
}

static void say_pictures(const job *j)
{
    if (j->facts.factor > 1)
        cli_note("pictures of %dx%d pixels are reduced by %d", j->facts.width, j->facts.height,
                 j->facts.factor);
    if (j->facts.holes > 0)
        cli_note("%s: holes (alpha 0) of %.3g %% of its solid angle, the most of all pictures",
                 j->facts.holes_of, 100 * j->facts.holes);
}

/* Pictures that still disagree. */
static void say_strangers(const job *j)
{
    const refined *r = &j->poses;

    for (int k = 0; k < j->n; k++)
        if (r->found.p[k].differs > fmax(STRANGE, 5 * r->found.after))
            cli_warn("%s: line %d (%s): its picture still disagrees with the others by %.2g %%",
                     j->p->positions, j->at.p[k].line, j->pictures[k], 100 * r->found.p[k].differs);
}

static void say_poses(const job *j)
{
    const refined *r = &j->poses;
    const double deg = 180 / 3.14159265358979323846;

    if (j->headings.n)
        cli_note("%s: %d headings found by a lamp, whose heights in the pictures meet to %.2g degrees",
                 j->p->positions, j->headings.n, j->headings.misfit * deg);

    for (int k = 0; k < r->wrong.n; k++)
        cli_warn("%s: %s%s (its picture disagrees with the others by %.2g %%, so by %.2g %%)",
                 j->p->positions, r->wrong.s[k].words,
                 j->p->refine == REFINE_NEVER ? "? Kept as given" : ": taken so", 100 * r->wrong.s[k].before,
                 100 * r->wrong.s[k].after);
    if (r->wrong.others > WRONG)
        cli_warn("%s: pictures still disagree at their places by %.2g %% (median of all)", j->p->positions,
                 100 * r->wrong.others);
    if (j->n > REFINE_MOST && j->p->refine != REFINE_NEVER)
        cli_note("poses are as given: of more than %d pictures none is refined", (int)REFINE_MOST);
    if (!r->tried) return;
    cli_note(
        "poses %s: corrections of %.3g in place, %.3g degrees, %.3g %% in gain (rms); pictures disagree by "
        "%.3g %%, %s %.3g %%",
        r->applied ? "were refined" : "are as given", r->shift, r->turn * deg, 100 * r->gain,
        100 * r->found.before, r->applied ? "now" : "and would by", 100 * r->found.after);
}

static void say_lamps(const job *j)
{
    int taken = 0;

    for (int i = 0; i < j->a.n; i++) taken += j->a.lamps[i].fate == TAKEN;
    if (j->p->keep_lamps)
        cli_note("%d of %d lamps found are in the probes again, behind what hides them", taken, j->a.n);
    else if (taken)
        cli_note("%d of %d lamps found taken out: %s is of version 2", taken, j->a.n, j->p->target);
    else cli_note("no lamp was taken out (%d found): %s is of version 1", j->a.n, j->p->target);
    if (!j->a.around.measured)
        cli_note("the surroundings were taken for a box of %.3g x %.3g x %.3g (mean mismatch of pictures "
                 "%.2g %%): "
                 "--geometry knows better",
                 j->a.around.box[1] - j->a.around.box[0], j->a.around.box[3] - j->a.around.box[2],
                 j->a.around.box[4], 100 * j->a.around.box[5]);
}

/* Nodes that the positions don't support. */
static void say_reach(const job *j)
{
    const double mean = sqrt(j->frame.len_u * j->frame.len_v / j->n);
    double worst = 0, sum = 0;

    for (int k = 0; k < j->n_u * j->n_v; k++) {
        const reach *r = &j->nodes[k];
        worst = fmax(worst, r->error), sum += r->error * r->error / (j->n_u * j->n_v);
        if (r->nearest > FAR * mean)
            cli_note("node (%d,%d) is %.3g from the nearest picture (pictures are %.3g apart): its light is "
                     "uncertain by "
                     "%.2g %%",
                     k % j->n_u, k / j->n_u, r->nearest, mean, 100 * r->error);
    }
    cli_note("light from above at the nodes is uncertain by %.2g %% (at most %.2g %%)", 100 * sqrt(sum),
             100 * worst);
}

int freepack(const freeplan *p, char *const *pictures, int n, errmsg *e)
{
    job j;
    lightfield f;
    int bad = job_make(&j, p, pictures, n, e) || load(&j, &f, e);

    if (!bad) {
        say_plan(&j), say_pictures(&j);
        bad = gaps_close(&f, BRIGHT * blobs_typical(&f), e) ||
              headings_find(&j.headings, &f, j.at.p, j.pictures, p->positions, e) ||
              refine(&j.poses, &f, j.at.p, j.pictures, p->octree, p->refine, e);
        if (bad) lf_free(&f);
    }
    if (!bad) {
        say_poses(&j);
        if (j.poses.tried) say_strangers(&j);
        bad = fill_gaps(&j, &f, e);
        if (bad) lf_free(&f);
        else bad = find_lamps(&j, &f, e);
    }
    if (!bad) {
        j.nodes = calloc((size_t)(j.n_u * j.n_v), sizeof *j.nodes);
        bad = j.nodes ? regrid_reach(j.nodes, &j.a, j.n_u, j.n_v, e) : err_set(e, "no memory for a grid");
    }
    if (!bad) {
        const freefacts facts = {p->positions, j.pictures, j.at.p,  &j.poses, j.n,
                                 j.n_u,        j.n_v,      j.plane, j.nodes};
        if (p->report) bad = freereport_write(p->report, &facts, &j.a, e);
    }
    if (!bad) bad = to_grid(&j, e) || write_out(&j, e);
    if (!bad) say_lamps(&j), say_reach(&j);
    job_free(&j);
    return bad ? -1 : 0;
}
