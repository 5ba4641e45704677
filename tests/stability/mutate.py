"""Break the code on purpose, one thing at a time, and see which test notices.

    python tests/stability/mutate.py [NAME ...]

Each mutation is a substitution of one text in one file.  It is made in a copy of the tree under build/mutants, what
depends on it is built there, and the named test is run: it must fail (its own failure, not that of the build).  Before that,
the same tests must pass in the unbroken copy.  build/mutations.csv: mutation, file, test, verdict.
"""
import csv
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
COPY = TOP / "build" / "mutants"

# name: (file, old, new, what make builds, test that must notice)
EVAL, FILES, STIFF, FAULTS = "tests/ilfmat/test_ilf_eval.py::", "tests/ilfmat/test_ilf_files.py::", "tests/hdrgen/test_hdrgen_stiff.py::", "tests/stability/test_faults.py::"
LOOKUP, CORPUS, STAGE = "tests/stability/test_lookup.py::", "tests/stability/test_corpus.py::", "tests/stagectl/test_stagectl_faults.py::"
LAMPS, STRATA = "tests/ilfmat/test_ilf_lamps.py::", "tests/ilfmat/test_ilf_lamps_light.py::"
TRACE, LIGHT = "build/bin/ilftrace build/test/ilfstorm", "tests/ilfmat/test_ilf_light.py::"

MUTATIONS = {
    # ---- the lookup
    "pole-without-mean": ("ilfmat/lookup/ilf_eval_avx2.c", "if (__builtin_expect(t.poles, 0)) add_poles", "if (0) add_poles", TRACE, EVAL + "test_ilftrace_at_poles_seams_nodes_and_edges"),
    "pole-jumps": ("ilfmat/lookup/ilf_eval_avx2.c", "two = _mm256_set1_pd(2);", "two = _mm256_set1_pd(1.8);", TRACE, LOOKUP + "test_rays_by_the_million"),
    "clamp-of-plane-coordinates": ("ilfmat/lookup/ilf_eval_avx2.c", "last), _mm_setzero_pd()), last);", "last), _mm_setzero_pd()), _mm_sub_pd(last, _mm_set1_pd(1e-3)));", TRACE, EVAL + "test_ilftrace_extreme_planes"),
    "polarValid-ignored": ("ilfmat/lookup/ilf_eval_avx2.c", "_mm256_set1_pd(f->info.polar_valid)", "_mm256_set1_pd(f->info.polar_max)", TRACE, EVAL + "test_ilftrace_polar_valid"),
    "seam-not-wrapped": ("ilfmat/lookup/ilf_eval_avx2.c", "_mm_add_epi32(x, _mm_and_si128(before, n))", "_mm_andnot_si128(before, x)", TRACE, LOOKUP + "test_rays_by_the_million"),
    "grazing-cut-early": ("ilfmat/lookup/ilf_eval_avx2.c", "if (!(dn < 0)) return ILF_UNUSUAL;", "if (!(dn < 1e-9)) return ILF_UNUSUAL;", TRACE, EVAL + "test_ilftrace_near_parallel_rays"),
    "reciprocal-of-a-denormal": ("ilfmat/lookup/ilf_eval.c", "(vec){a.u / size, a.v / size, a.n / size}; /*", "(vec){a.u * (1 / size), a.v * (1 / size), a.n * (1 / size)}; /*", "build/test/fuzz_rays", CORPUS + "test_replay[rays]"),
    "overflow-far-away": ("ilfmat/lookup/ilf_eval.c", "if (!(largest(h) < 1e300)) {", "if (0) {", "build/test/fuzz_rays", CORPUS + "test_replay[rays]"),
    "no-depth-correction": ("ilfmat/lookup/ilf_eval.c", "const int corrected = hit && mode == ILF_DEPTH;\n\n    if (f->fast", "const int corrected = hit && mode != ILF_DEPTH;\n\n    if (f->fast", TRACE, EVAL + "test_ilftrace_agrees"),
    "skewed-plane-taken-as-square": ("ilfmat/lookup/ilf_eval_avx2.c", "_mm256_fnmadd_pd(qu, skew, _mm256_sub_pd(_mm256_set1_pd(hv), qv))", "_mm256_sub_pd(_mm256_set1_pd(hv), qv)", TRACE, EVAL + "test_ilftrace_extreme_planes"),
    "rel-in-float": ("ilfmat/lookup/ilf_eval_avx2.c", "x = from[0] - fr->origin[0],", "x = (double)((float)from[0] - (float)fr->origin[0]),", TRACE, LOOKUP + "test_error_growth_with_offset"),
    "half-blue-lost": ("ilfmat/lookup/ilf_eval_avx2.c", "pair(g, x0, x1, apart), pair(b, x0, x1, apart)));", "pair(g, x0, x1, apart), pair(g, x0, x1, apart)));", TRACE, EVAL + "test_ilftrace_reads_each_compression"),
    "any-ray-differs": ("ilfmat/lookup/ilf_eval.c", "at.top = fmax(2 * fy + 1, 0);", "at.top = 1;", "build/test/ilfboth", "tests/ilfmat/test_ilf_interleaved.py::test_any_ray_and_usual_rays[half-sphere]"),
    "second-part-believed": ("ilfmat/file/ilf_probe.c", "(p->checked || ilf_same_texels(f, f->map + second.data_offset, chunk.data_offset))", "1", TRACE + " build/bin/ilfinfo build/test/ilfboth build/test/ilfcopy", "tests/ilfmat/test_ilf_interleaved.py::test_edited_first_part_counts"),
    "infinity-taken-as-a-hit": ("ilfmat/lookup/ilf_many.c", "return h && !isinf(h[0]) && !isinf(h[1]) && !isinf(h[2]) ? h : NULL;", "return h;", "build/test/ilfmany", EVAL + "test_many_rays_at_once_are_as_one_by_one[False]"),
    "last-ray-forgotten": ("ilfmat/lookup/ilf_many.c", "n - from < PIECE ? n : from + PIECE", "n - from < PIECE ? n - 1 : from + PIECE", "build/test/ilfmany", EVAL + "test_many_rays_at_once_are_as_one_by_one[False]"),
    # ---- the file
    "truncation-unseen": ("common/exr/exr_tiles.c", "exr_tile_head(head, w->several).size <= w->end - at - bytes", "1", TRACE, LOOKUP + "test_truncation_is_seen_at_once"),
    "table-unchecked": ("common/exr/exr_tiles.c", "if (at < first || at >= file_bytes) {", "if (0) {", TRACE, LOOKUP + "test_truncation_is_seen_at_once"),
    "nan-half-accepted": ("ilfmat/file/ilf_probe.c", "(h & 0x7c00u) == 0x7c00u", "h == 0x7c00u", TRACE, FILES + "test_texel_that_is_no_number_is_named"),
    "change-unseen": ("ilfmat/file/ilf_probe.c", "    struct stat st;\n\n    if (fstat(f->fd, &st) != 0) return", "    struct stat st;\n\n    if (f->fd >= 0) return ILF_OK;\n    if (fstat(f->fd, &st) != 0) return", TRACE, "tests/stability/test_sharing.py::test_overwritten_while_read"),
    "dwa-by-name": ("ilfmat/file/ilf_dwa.c", "ImfOpenTiledInputFile(name)", "ImfOpenTiledInputFile(f->path)", TRACE, "tests/stability/test_sharing.py::test_replaced_while_read"),
    "not-perpendicular-accepted": ("ilfmat/lookup/ilf_frame.c", "if (fabs(uv) > 1e-4)", "if (fabs(uv) > 1e-2)", TRACE + " build/bin/ilfinfo", FILES + "test_edges_are_perpendicular"),
    "texel-beyond-half-packed": ("ilfmat/file/ilf_write.c", "if (fabsf(rgb[k]) > 65504.f)", "if (0)", "build/bin/ilfpack", "tests/ilfmat/test_ilf_commands.py::test_ilfpack_refuses"),
    # ---- lamps in files and along rays
    "lamps-behind-the-hit": ("ilfmat/lookup/ilf_lit.c", "(!l->far && t > (1 + FLUSH) * reach)", "0", TRACE, LAMPS + "test_a_lamp_behind_the_hit_is_not_seen"),
    "flush-lamps-lost": ("ilfmat/lookup/ilf_lit.c", "#define FLUSH 0.01", "#define FLUSH 0.001", TRACE, LAMPS + "test_a_lamp_behind_the_hit_is_not_seen"),
    "dark-lamps-met": ("ilfmat/lookup/ilf_lit.c", "t >= best || is_out(l)", "t >= best", TRACE, LAMPS + "test_a_lamp_put_out_is_not_there"),
    "lamps-from-the-plane": ("ilfmat/lookup/ilf_lit.c", "if (hit && origin && mode == ILF_DEPTH) ilf_lamp_point(o", "if (0) ilf_lamp_point(o", TRACE, LAMPS + "test_masks_below_the_origin_do_not_count"),
    "lamps-not-scaled": ("ilfmat/lookup/ilf_lit.c", "fr->len_u == f->frame.len_u ? 1 : f->frame.len_u / fr->len_u;", "1;", TRACE, LAMPS + "test_in_other_planes[scaled]"),
    "masks-ignored": ("ilfmat/lookup/ilf_lit.c", "const double pass = ilf_luminaire_pass(l, o, d), rest", "const double pass = 1, rest", TRACE, LAMPS + "test_every_shape_behind_every_mask[layer]"),
    "sheet-below-counts": ("ilfmat/lamps/ilf_mask.c", "if (gap <= 0 || rise <= 0", "if (rise <= 0", TRACE, LAMPS + "test_masks_below_the_origin_do_not_count"),
    "stack-below-counts": ("ilfmat/lamps/ilf_mask.c", "if (h <= o[2] || h >= c[2]) continue;", "if (h >= c[2]) continue;", TRACE, LAMPS + "test_every_shape_behind_every_mask[stack]"),
    "what-adds-multiplies": ("ilfmat/lamps/ilf_mask.c", "if (l->masks[k].adds) sum += v;", "if (l->masks[k].adds) product *= v;", TRACE, LAMPS + "test_masks_multiply_and_add"),
    "link-forgotten": ("ilfmat/file/ilf_lamprow.c", "row[1] = (float)m->link, row[2]", "row[2]", "build/test/ilfcopy " + TRACE + " build/bin/ilfinfo", LAMPS + "test_written_it_is_the_same[options0]"),
    "digest-without-lamps": ("ilfmat/file/ilf_digest.c", "    lamps_digest(h, f);\n    *digest", "    if (0) lamps_digest(h, f);\n    *digest", "build/test/ilfcopy", LAMPS + "test_the_digest_counts_lamps"),
    "digest-without-pictures": ("ilfmat/file/ilf_digest.c", "for (int64_t s = 0; s < n; s++) h[s & 1]", "for (int64_t s = 0; s < 0 * n; s++) h[s & 1]", "build/test/ilfcopy", LAMPS + "test_the_digest_counts_lamps"),
    "unused-numbers-taken": ("ilfmat/file/ilf_lamprow.c", "used ? rules[k].most : 0,", "used ? rules[k].most : MOST,", "build/bin/ilfinfo", LAMPS + "test_every_number_is_checked[sphere]"),
    "samples-unchecked": ("ilfmat/file/ilf_lamprow.c", "if (!isfinite(m->grid[k]))", "if (0)", "build/bin/ilfinfo", LAMPS + "test_parts_that_are_not_what_they_should_be[not finite]"),
    "pictures-unbounded": ("ilfmat/file/ilf_lampread.c", "if (st == ILF_OK && *samples > MOST_SAMPLES)", "if (0)", "build/bin/ilfinfo", LAMPS + "test_pictures_have_a_bound_before_memory_is_taken"),
    "halves-beyond-halves": ("ilfmat/file/ilf_lampwrite.c", "if (fabsf(m->grid[k]) > 65504.f) return EXR_PIXEL_FLOAT;", "if (0) return EXR_PIXEL_FLOAT;", "build/test/ilfcopy", LAMPS + "test_pictures_are_halves_where_halves_hold_them"),
    "channels-in-number-order": ("ilfmat/file/ilf_lampwrite.c", "qsort(lamp, (size_t)n, sizeof *lamp, by_channel);", "(void)by_channel;", "build/test/ilfcopy build/bin/ilfinfo build/bin/ilftrace", LAMPS + "test_written_it_is_the_same[options0]"),
    "export-upside-down": ("tools/ilflamps/exportrad.c", "m%d_y m%d_x\\n0", "m%d_x m%d_y\\n0", "build/bin/ilflamps", "tests/ilflamps/test_version2.py::test_exported_lamps_are_as_bright_behind_what_hides_them"),
    "history-lost": ("tools/ilflamps/output.c", "spec.owner = notes.owner, spec.cap_date", "spec.cap_date", "build/bin/ilflamps", "tests/ilflamps/test_version2.py::test_handed_on_as_it_is"),
    # ---- sampling
    "patch-narrower-than-it-is": ("ilfmat/sampling/ilf_slice.c", "const double reach = cone + HALF_CELL;", "const double reach = 1e-3 + 0 * (cone + HALF_CELL);", "build/test/ilfdraw", "tests/ilfmat/test_ilf_sampling.py::test_no_direction_with_excess_is_missed[lamps-box]"),
    "things-behind-lamps-lost": ("ilfmat/sampling/ilf_patch.c", "HALVINGS = 3, MAX_LAYERS = 6", "HALVINGS = 3, MAX_LAYERS = 1", "build/test/ilfdraw", "tests/ilfmat/test_ilf_sampling.py::test_light_shows_on_what_stands_behind_a_lamp"),
    "density-too-high": ("ilfmat/sampling/ilf_draw.c", "(1 - SLICE_UNIFORM) * map;", "(1 - SLICE_UNIFORM) * map * 1.05;", "build/test/ilfdraw", "tests/ilfmat/test_ilf_sampling.py::test_integrals_of_the_density"),
    "light-under-the-horizon-unseen": ("ilfmat/sampling/ilf_patches.c", "pl->mode == ILF_DEPTH ? ILF_PI : ILF_PI / 2", "ILF_PI / 2", "build/bin/rtrace", "tests/radiance_patch/test_radiance_lamps.py::test_light_below_the_probes_horizon_is_aimed_at"),
    "rounded-downwards": ("ilfmat/file/ilf_round.c", "u = (u + half + (u >> cut & 1)) & ~below;", "u &= ~below;", "build/bin/ilfpack", "tests/ilfpack/test_ilfpack_shrink.py::test_up_as_often_as_down"),
    "weights-in-radiance": ("ilfmat/sampling/ilf_patches.c", "(double)pl->p[k].excess / pl->unit, LEAST_WEIGHT", "(double)pl->p[k].excess, 0", "build/test/ilfdraw", LOOKUP + "test_sampler_at_any_level"),
    # ---- the estimator
    "chosen-counts-too-much": ("ilfmat/sampling/ilf_light.c", "draws = l->candidates > 0 ? l->candidates : 1;", "draws = l->n;", "build/test/ilflight", LIGHT + "test_mean_is_the_integral"),
    "chosen-counts-once": ("ilfmat/sampling/ilf_light.c", "for (; next < passed; next += step) c->times++;", "for (; next < passed; next += step) c->times = 1;", "build/test/ilflight", LIGHT + "test_white_furnace"),
    "lamps-drawn-twice": ("ilfmat/sampling/ilf_candidates.c", "if (!(f > 0) || ilf_meets_lamp(l, c->dir)) continue;", "if (!(f > 0)) continue;", "build/test/ilflight", STRATA + "test_mean_is_the_integral"),
    "lamps-share-forgotten": ("ilfmat/sampling/ilf_strata.c", "c->weight = c->target / pdf * share;", "c->weight = c->target / pdf;", "build/test/ilflight", STRATA + "test_mean_is_the_integral"),
    "lamps-behind-lamps-drawn": ("ilfmat/sampling/ilf_strata.c", "if (ilf_nearest_lamp(p->field, o, d, HUGE_VAL) != k) continue;", "if (ilf_nearest_lamp(p->field, o, d, HUGE_VAL) < 0) continue;", "build/test/ilflight", STRATA + "test_mean_is_the_integral"),
    "scratch-shared": ("ilfmat/sampling/ilf_light.c", "    s->scratch = NULL;\n    if (!m ||", "    if (!m ||", "build/test/ilflight", LIGHT + "test_lighting_within_lighting"),
    "cones-counted-twice": ("ilfmat/sampling/ilf_glint.c", "if (cone_of(gl, k, dir) >= 0) continue;", "if (0) continue;", "build/test/ilflight", LIGHT + "test_glints_and_blind_rays_are_all_that_the_ball_shows"),
    "glint-counts-twice": ("ilfmat/sampling/ilf_part.c", "way->scattered || way->in_glint", "way->scattered", "build/test/ilflight", LIGHT + "test_glints_and_blind_rays_are_all_that_the_ball_shows"),
    "split-counts-twice": ("ilfmat/sampling/ilf_part.c", "(part & ILF_BASE ? 1 - excess : 0)", "(part & ILF_BASE ? 1 : 0)", "build/bin/rtrace", "tests/radiance_patch/test_radiance_di.py::test_irradiance_is_the_oracles_integral"),
    "lamps-coefficients": ("radiance_patch/m_ilf.c", "hp->r->rparts = DIRBLIND |", "hp->r->rparts =", "build/bin/rtrace", "tests/radiance_patch/test_radiance_di.py::test_coefficients_are_those_of_scattered_rays[varnish-0]"),
    # ---- hdrgen
    "clipped-code-trusted": ("tools/hdrgen/mergetab.c", "v->valid = z < top;", "v->valid = 1;", "build/bin/hdrgen", "tests/stability/test_weights.py::test_clipped_against_expectation"),
    "weights-not-zero-at-the-ends": ("tools/hdrgen/mergetab.c", "else if (inside) w = 2 * fmin(z, top - z) / top;", "else w = 2 * fmin(z + 1, top + 1 - z) / top;", "build/bin/hdrgen", "tests/stability/test_weights.py::test_ends_of_the_range_weigh_nothing"),
    "smoothness-forgotten": ("tools/hdrgen/debevec.c", "curve_penalty(q, f->b, f->lambda, NULL)", "curve_penalty(q, f->b, 0 * f->lambda, NULL)", "build/bin/hdrgen", "tests/stability/test_conditioning.py::test_smoothness_acts"),
    "response-not-monotone": ("tools/hdrgen/response.c", "while (blocks > 1 && mean[blocks - 1] < mean[blocks - 2]) {", "while (blocks > 1 && mean[blocks - 1] < mean[blocks - 2] - 1) {", "build/test/hdrgenparts", "tests/hdrgen/test_hdrgen_parts.py::test_monotone_is_isotonic_regression_of_the_logarithm"),
    "time-read-as-zero": ("tools/hdrgen/times.c", "|| !(t > 0)) {", ") {", "build/test/fuzz_times build/bin/hdrgen", "tests/hdrgen/test_hdrgen.py::test_bad_times"),
    # ---- fishremap, falloffcal
    "jacobian-constant": ("tools/fishremap/weights.c", "(float)(per_area_at(&src->lens, (double)k / TABLE, 0.5 / src->radius)", "(float)(per_area_at(&src->lens, 0.0 * k / TABLE, 0.5 / src->radius)", "build/bin/fishremap", "tests/stability/test_remap.py::test_mean_of_a_hemisphere"),
    "table-off-the-axis": ("tools/fishremap/lens.c", "if (l->tab_t[0] != 0 || l->tab_r[0] != 0)", "if (0)", "build/test/fuzz_lens", CORPUS + "test_replay[lens]"),
    "inverse-ends-early": ("tools/fishremap/lens.c", "if (least <= 2 * DBL_EPSILON * r) break;", "if (least <= 1e-9) break;", "build/test/fuzz_lens", CORPUS + "test_replay[lens]"),
    "chords-too-long": ("tools/fishremap/outline.c", " || step / m > WIDEST", "", "build/bin/fishremap", "tests/fishremap/test_fishremap.py::test_texels_that_are_wholly_seen_have_alpha_one[0]"),
    "falloff-may-rise": ("tools/fishremap/falloff_fit.c", "if (rises && solve_monotone", "if (rises && 0 && solve_monotone", "build/bin/falloffcal", "tests/stability/test_conditioning.py::test_flat_and_noisy"),
    "falloff-trusts-all": ("tools/fishremap/falloff_outliers.c", "if (d->n < 5) return 0;", "if (d->n >= 0) return 0;", "build/bin/falloffcal", "tests/fishremap/test_falloffcal.py::test_wild_outliers_survive"),
    # ---- stagectl
    "journal-not-synced": ("tools/stagectl/shot.c", "    if (journal_sync(r->j, e) != 0) return -1;\n    while", "    while", "build/bin/stagectl build/bin/virtualstage", FAULTS + "test_order_of_the_journal"),
    "journal-before-its-files": ("tools/stagectl/journal.c", "syncfs(j->lock_fd) != 0 || fdatasync(j->fd) != 0", "fdatasync(j->fd) != 0 || syncfs(j->lock_fd) != 0", "build/bin/stagectl build/bin/virtualstage", FAULTS + "test_order_of_the_journal"),
    "checksum-unchecked": ("tools/stagectl/journal.c", "crc == crc_of(line + 9, n - 9) ?", "crc + 1 > 0 ?", "build/bin/stagectl build/bin/virtualstage", STAGE + "test_damage_in_the_middle_is_refused"),
    "empty-journal-accepted": ("tools/stagectl/journal.c", "if (st.st_size == 0) return", "if (st.st_size < 0) return", "build/bin/stagectl build/bin/virtualstage", STAGE + "test_damage_in_the_middle_is_refused"),
    "any-place-believed": ("tools/stagectl/grbl_move.c", "> 0.5 / s->facts.steps_per_mm[a] + 1.02 * digit)", "> 5e6 / s->facts.steps_per_mm[a] + 1.02 * digit)", "build/bin/stagectl build/bin/virtualstage", "tests/stagectl/test_stagectl.py::test_a_position_that_is_not_the_target_is_not_believed"),
    "names-unquoted": ("tools/stagectl/names.c", "quoted ? u->file : file, 0},", "file, 0},", "build/bin/stagectl build/bin/virtualstage", STAGE + "test_names_with_blanks_and_quotes_are_safe_in_a_shell"),
    "names-foreseeable": ("tools/stagectl/shot.c", "\".shot-%016\" PRIx64 \"%s\", number, ending", "\".shot-%016\" PRIx64 \"%s\", number & 15, ending", "build/bin/stagectl build/bin/virtualstage", "tests/stability/test_sharing.py::test_temp_names"),
    # ---- common
    "rename-before-sync": ("common/base/outfile.c", "|| sync_file(fd) < 0 || rename(", "|| rename(", "build/bin/ilfpack", FAULTS + "test_order_of_an_output[ilfpack]"),
    "written-in-place": ("common/base/outfile.c", "    if (o->slot) {\n        if (remove_it) unlink", "    if (o->slot) {\n        if (remove_it < 0) unlink", "build/bin/hdrgen", FAULTS + "test_errors_at_the_nth_call[hdrgen-hdr]"),
    "write-error-unnoticed": ("common/base/outfile.c", "int bad = ferror(o->stream);\n    if (fflush(o->stream) == EOF) bad = 1;", "int bad = 0;\n    fflush(o->stream);", "build/bin/hdrgen", FAULTS + "test_errors_at_the_nth_call[hdrgen-hdr]"),
    "sizes-unchecked": ("common/image/image.c", "width > IMG_MAX_SIDE || height > IMG_MAX_SIDE ||\n        width * height > IMG_MAX_PIXELS)", "width < 0)", "build/bin/fishremap", "tests/stability/test_sharing.py::test_products_of_sizes"),
    "run-length-unchecked": ("common/image/image_hdr.c", "if (x == 0 || run > s->length - x) return", "if (x == 0) return", "build/test/fuzz_hdr build/test/imgtool", CORPUS + "test_replay[hdr]"),
}

def sh(words, **kw):
    return subprocess.run(words, cwd=COPY, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **kw)


def make(targets):
    env = {k: v for k, v in os.environ.items() if not k.startswith("MAKE") and k != "MFLAGS"}
    return sh(["make", "-j2", *targets.split()], env=env)


def test(name):
    """A program that loops is ended by process.py, one that waits for ever by the clock: a hang is a failure too."""
    python = COPY / "build/venv/bin/python"
    env = {**os.environ, "ILF_BUILD": "build", "ILF_SHARED": str((TOP / os.environ.get("ILF_SHARED", "../shared")).resolve())}
    try:
        return sh([str(python), "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", name], env=env, timeout=3600)
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(name, 1, "hangs\n1 failed")


def copy_tree():
    names = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=TOP, capture_output=True, text=True, check=True).stdout
    shutil.rmtree(COPY, ignore_errors=True)
    COPY.mkdir(parents=True)
    for name in names.splitlines():
        if (TOP / name).is_file():
            (COPY / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(TOP / name, COPY / name)
    (COPY / "build").mkdir()
    for part in ("bin", "lib", "obj", "radiance", "test", ".debs-radiance", ".debs-tools", ".debs-test"):
        if (TOP / "build" / part).exists():
            subprocess.run(["cp", "-a", str(TOP / "build" / part), str(COPY / "build")], check=True)
    (COPY / "build/venv").symlink_to((TOP / "build/venv").resolve())
    (COPY / "setup/venv.sh").touch()
    for stamp in (COPY / "setup/venv.sh", COPY / "setup/requirements.txt"):
        os.utime(stamp, (0, 0))


def main(wanted):
    unknown = set(wanted) - set(MUTATIONS)
    if unknown:
        sys.exit(f"mutate: expected names of mutations, found {' '.join(sorted(unknown))}")
    chosen = {k: v for k, v in MUTATIONS.items() if not wanted or k in wanted}
    copy_tree()
    missed, rows, passes = [], [], {}
    for name, (file, old, new, targets, check) in chosen.items():
        path, start = COPY / file, time.monotonic()
        whole = path.read_text()
        if whole.count(old) != 1:
            missed.append(name)
            rows.append([name, file, check, f"the text to change stands there {whole.count(old)} times"])
            print(*rows[-1], flush=True)
            continue
        if check not in passes:
            built = make(targets)
            passes[check] = built.returncode == 0 and test(check).returncode == 0
        path.write_text(whole.replace(old, new))
        built = make(targets)
        if not passes[check]:
            verdict = "the test fails without it, too"
        elif built.returncode:
            verdict = "does not build: " + built.stdout[-300:].replace("\n", " ")
        else:
            p = test(check)
            verdict = "caught" if p.returncode == 1 and "failed" in p.stdout else "error" if p.returncode not in (0, 1) else "NOT CAUGHT"
        path.write_text(whole)
        rows.append([name, file, check, verdict])
        if verdict != "caught":
            missed.append(name)
        print(f"{name:32} {file:32} {verdict}  ({check}, {time.monotonic() - start:.0f} s)", flush=True)
    with open(TOP / "build/mutations.csv", "w", newline="") as f:
        w = csv.writer(f, lineterminator="\n")
        w.writerow(["mutation", "file", "test", "verdict"])
        w.writerows(rows)
    print(f"{len(rows) - len(missed)} of {len(rows)} caught; build/mutations.csv")
    shutil.rmtree(COPY, ignore_errors=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
