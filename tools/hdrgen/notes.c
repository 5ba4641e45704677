/*
 * notes.c - see notes.h.
 */
#include "notes.h"

#include <stdio.h>

#include "base/cli.h"

void notes_exposures(const job *j)
{
    const times_facts *t = &j->facts.times;
    const stated_facts *s = &j->facts.stated;
    if (j->facts.assumed_time) cli_note("%s: no exposure time: 1 s assumed", j->shots[0].path);
    if (t->alone)
        cli_note(
            "ISO or f-number differ and are not stated by all images: the given times are taken as they are");
    else if (t->varies) cli_note("ISO or f-number vary: taken into account relative to %s", j->shots[0].path);
    if (t->iso_assumed > 0) cli_note("%s: no ISO: %g as the other images", t->lacks_iso, t->iso_assumed);
    if (t->f_assumed > 0) cli_note("%s: no f-number: %g as the other images", t->lacks_f, t->f_assumed);
    if (s->worst)
        cli_warn("%s: time, ISO and f-number say %.1f stops more light than %s, the pixels %s%.1f: if the "
                 "times are wrong, give --times",
                 j->shots[s->worst].path, s->says, j->shots[s->worst - 1].path,
                 frames_get_facts(j->frames)->raw ? "" : "about ", s->shows);
}

void notes_colours(const job *j)
{
    const develop_facts *d = &j->facts.develop;
    double pixels = (double)j->radiance.info.width * j->radiance.info.height;
    if (!d->camera) return;
    if (d->balance_differs > 0)
        cli_note("the images' white balances differ (by up to %.0f %%): that of %s is taken for all",
                 100 * d->balance_differs, j->shots[d->balance_from].path);
    if (d->balance_from < 0)
        cli_note("%s: no white balance as shot: %s", j->shots[0].path,
                 d->daylight ? "daylight's is taken" : "none applied");
    if (d->no_matrix)
        cli_note("%s: no colour matrix known for %s: colours are the camera's own", j->shots[0].path,
                 d->camera);
    if (d->outside)
        cli_note("%ld pixels (%.3g %%) of colours beyond the primaries of %s: negative values%s", d->outside,
                 100 * (double)d->outside / pixels, colour_name(j->opts.colour),
                 j->opts.colour == COLOUR_SRGB ? " (--colour acescg or xyz hold more)" : "");
}

void notes_turn(const job *j)
{
    const develop_facts *d = &j->facts.develop;
    if (d->turns_differ)
        cli_note(
            "the images' orientation tags differ: their pixels lie alike, all are turned as %s says (%d)",
            j->shots[0].path, d->orientation);
    if (d->orientation != 1 && (j->opts.flat || j->opts.hot || j->opts.dark))
        cli_note(
            "orientation %d: --dark, --flat and --hot are taken to lie as the images' pixels in their files",
            d->orientation);
}

/* Why nothing was taken out. */
static const char *no_flare(const flare_found *f)
{
    if (f->verdict == FLARE_ONE_LAMP)
        return "one lamp's surroundings alone can't tell it from light that is there: nothing taken out";
    if (f->verdict == FLARE_UNSETTLED) return "the lamps' surroundings do not agree on it: nothing taken out";
    return "none found";
}

void notes_flare(const job *j)
{
    const flare_facts *f = &j->facts.flare;
    const flare_found *a = &f->all;
    if (!j->opts.flare) return;
    if (!flare_is_certain(a)) {
        cli_note("flare: %s (at most %.2g %% of the light, %d lamps)", no_flare(a), 100 * a->most, f->lamps);
        return;
    }
    char each[96] = "";
    if (j->radiance.info.channels == 3)
        snprintf(each, sizeof each, " (%.3g, %.3g, %.3g)", 100 * (double)f->total[0],
                 100 * (double)f->total[1], 100 * (double)f->total[2]);
    cli_note("flare: the lens scattered %.3g %%%s of the light, give or take %.2g %% of that, at most %.3g "
             "%%: taken "
             "out, and back where it came from",
             100 * a->total, each, 100 * a->error, 100 * a->most);
    cli_note("flare: by %s; %d of %d dark places lie on it to %.2g %% rms",
             a->verdict == FLARE_DARK ? "what lies outside the circle"
                                      : "the surroundings of two groups of lamps",
             a->on, a->places, 100 * a->misfit);
    if (j->facts.clipped && a->verdict == FLARE_LAMPS)
        cli_note("flare: lamps clipped in every exposure scatter more than their values say");
}

void report_shots(const job *j)
{
    const develop_facts *d = &j->facts.develop;
    for (int k = 0; k < j->n; k++) {
        const shot *s = &j->shots[k];
        fprintf(stderr, "%s: %.6g s", s->path, s->seconds);
        if (s->f_number > 0) fprintf(stderr, ", f/%.3g", s->f_number);
        if (s->iso > 0) fprintf(stderr, ", ISO %g", s->iso);
        fprintf(stderr, ": exposure %.6g\n", s->exposure);
    }
    if (!d->camera) return;
    const int *clip = frames_get_facts(j->frames)->clip;
    fprintf(stderr,
            "%s: black %d %d %d, clipped from %d %d %d above it on; white balance %.4g %.4g %.4g%s%s, "
            "colours %s\n",
            d->camera, frames_sensor(j->frames, 0)->black[0], frames_sensor(j->frames, 0)->black[1],
            frames_sensor(j->frames, 0)->black[2], clip[0], clip[1], clip[2], d->balance[0], d->balance[1],
            d->balance[2], d->balance_from >= 0 ? " of " : "",
            d->balance_from >= 0 ? j->shots[d->balance_from].path : "", colour_name(j->opts.colour));
}
