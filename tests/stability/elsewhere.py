"""Cases whose tests stand with their parts: test -> (case, file guarded, condition, expected).

    python tests/stability/elsewhere.py     the tests, for pytest's command line
"""
HDR, FISH, STAGE, ILF, COMMON = "tools/hdrgen/", "tools/fishremap/", "tools/stagectl/", "ilfmat/", "common/"

E = {
    "ilfmat/test_ilf_eval.py": {
        "test_ilftrace_near_parallel_rays": ("rays nearly parallel to the plane", ILF + "lookup/ilf_eval.c", "d.n 1e-300 .. 1e-3 of |d|", "oracle to 1e-5, finite"),
        "test_ilftrace_extreme_planes": ("plane far away, tiny, huge, of ratio 1e6", ILF + "lookup/ilf_frame.c", "origin 1e6; |U| 1e-6, 1e6; |U|/|V| 1e6", "oracle to 1e-5"),
        "test_ilftrace_keeps_the_whole_range_of_values": ("radiance over all a float or half can hold", ILF + "lookup/ilf_eval_avx2.c", "1e-38..1e38, denormals, above 65504", "the value to 1e-5"),
        "test_ilftrace_one_lit_texel": ("one lit texel", ILF + "lookup/ilf_eval.c", "1 of 2048 texels", "itself, and 0 elsewhere"),
        "test_ilftrace_at_poles_seams_nodes_and_edges": ("rays through pole, seam, nodes, edges, origin on and below the plane", ILF + "lookup/ilf_eval.c", "16 directions x 12 hits", "oracle to 1e-5"),
        "test_ilftrace_polar_valid": ("data discounted beyond polarValid", ILF + "lookup/ilf_eval.c", "polarValid 0.2 .. 3.1", "held at polarValid"),
        "test_ilftrace_agrees": ("1x1, 1xm, 2x2 grids, 1-pixel probes", ILF + "lookup/ilf_eval.c", "all grid and probe shapes", "oracle to 1e-5"),
        "test_ilftrace_refuses_what_is_no_ray": ("rays that are no rays", ILF + "programs/ilftrace.c", "too few, too many, NaN, words", "one line, exit 1"),
    },
    "ilfmat/test_ilf_files.py": {
        "test_edges_are_perpendicular": ("U and V nearly parallel", ILF + "lookup/ilf_frame.c", "U.V 1e-5 .. 1 |U||V|", "to 1e-4 accepted, else refused"),
        "test_truncated_anywhere": ("light field file cut at any byte", ILF + "file/ilf_file.c", "every length", "refused, one line"),
        "test_flipped_bytes_never_crash": ("light field file with flipped bytes", ILF + "file/ilf_probe.c", "each compression", "refused or finite"),
        "test_tile_table_that_points_nowhere": ("tile table that points nowhere", ILF + "file/ilf_file.c", "offsets 0 .. 2^64-1", "refused, one line"),
        "test_sizes_that_cannot_be": ("grids and probes of absurd size", ILF + "file/ilf_file.c", "up to 2^31 texels a side", "refused before memory is taken"),
        "test_texel_that_is_no_number_is_named": ("NaN and infinite texels", ILF + "file/ilf_probe.c", "half, float, each compression", "refused, probe and pixel named"),
        "test_file_that_changes_while_it_is_used": ("light field written over while it is open", ILF + "file/ilf_probe.c", "in place, shorter, by rename", "refused, or the old one whole"),
    },
    "ilfmat/test_ilf_sampling.py": {
        "test_no_direction_with_excess_is_missed": ("lamps that only a part of a cube of space sees", ILF + "sampling/ilf_slice.c", "all fields, geometries", "density > 0 wherever there is excess"),
        "test_black_field_has_nothing_bright": ("a black light field sampled", ILF + "sampling/ilf_patches.c", "mean 0", "no patch, no NaN"),
        "test_far_corners_of_space_are_answered": ("points far from the light field", ILF + "sampling/ilf_slice.c", "1e3 .. 1e15 plane widths", "answered or refused"),
    },
    "ilfmat/test_ilf_commands.py": {
        "test_ilfpack_refuses": ("probes that can't be packed", ILF + "programs/ilfpack.c", "sizes, values beyond half, NaN", "refused, named"),
        "test_ilfpack_failure_keeps_the_old_file": ("packing that fails", COMMON + "base/outfile.c", "last probe bad", "old file whole, nothing left"),
    },
    "radiance_patch/test_radiance_di.py": {
        "test_scaled_scenes": ("sampled irradiance of scaled scenes", "radiance_patch/m_ilf.c", "scale 1e-3, 1e3", "integral to 5 sigma"),
        "test_irradiance_is_the_oracles_integral": ("threshold split: base + excess = all", "ilfmat/sampling/ilf_part.c", "all fields and surfaces, -di 16", "the integral to 5 sigma"),
    },
    "hdrgen/test_hdrgen_stiff.py": {
        "test_two_exposures": ("response from two exposures", HDR + "debevec.c", "2 exposures, ratio 4", "median error < 0.05 stops"),
        "test_identical_exposures_cannot_tell_the_response": ("identical exposures", HDR + "debevec.c", "4 times the same time", "refused: no different exposures"),
        "test_identical_exposures_average": ("identical exposures, response given", HDR + "merge.c", "8 times the same time", "noise falls by more than 2"),
        "test_times_a_million_apart": ("exposure times far apart", HDR + "debevec.c", "ratio 1e6", "refused, or right with a response"),
        "test_gap_between_exposures_is_bounded_and_flagged": ("radiance that no exposure sees", HDR + "merge.c", "gap of 3 decades", "between its bounds, flagged"),
        "test_smoothness_over_twelve_decades": ("smoothness of the response", HDR + "debevec.c", "lambda 1e-6 .. 1e6", "median error < 0.03 stops"),
        "test_all_clipped": ("series clipped in every exposure", HDR + "merge.c", "1280 of 1280 pixels", "refused, or the bound, flagged"),
        "test_all_black": ("series black in every exposure", HDR + "merge.c", "1280 of 1280 pixels", "refused, or the bound, flagged"),
        "test_sixteen_bit": ("16-bit response", HDR + "debevec.c", "65536 codes", "as good as with the true response"),
        "test_one_time_wrong_by_two": ("one exposure time wrong", HDR + "calibrate.c", "factor 2", "said, and put right on request"),
        "test_wrong_order_of_times_is_refused": ("times in the wrong order", HDR + "samples.c", "reversed", "refused, one line"),
        "test_seventeen_decades": ("scene of 17 decades", HDR + "merge.c", "1e-7 .. 1e10", "no bias in any decade"),
        "test_clipped_pixels_that_are_not_quite_white": ("clipping below the highest code", HDR + "mergetab.c", "1 .. 5 codes below", "not taken for light"),
    },
    "fishremap/test_falloffcal.py": {
        "test_three_angles": ("falloff from three angles", FISH + "falloff_fit.c", "3 readings", "within 3 %, deviations say so"),
        "test_wild_outliers_survive": ("falloff readings far off", FISH + "falloff_outliers.c", "several of 20, x 2 and more", "left out, curve within 2 %"),
        "test_a_proven_rise_is_kept": ("falloff that is not monotone", FISH + "falloff_fit.c", "rise of more than 3 sigma", "kept where it is proven"),
        "test_extrapolation_says_how_unsure_it_is": ("falloff beyond the last reading", FISH + "falloff_fit.c", "readings to 60 of 92.5 degrees", "within its stated deviation"),
    },
    "fishremap/test_fishremap.py": {
        "test_circle_partly_outside_the_frame": ("fisheye circle partly outside the frame", FISH + "plan.c", "up to half of it", "inside exact, outside marked"),
        "test_radiance_over_twelve_decades": ("remap over 12 decades", FISH + "weights.c", "1e-6 .. 1e6", "no bleeding beyond the footprint"),
        "test_bad_pixels_are_left_out": ("NaN and infinite pixels in a picture", FISH + "remap.c", "single and whole texels", "left out, never spread"),
        "test_huge_numbers_are_refused_or_answered": ("absurd sizes, fields, centres", FISH + "options.c", "up to 1e300", "refused or finite"),
        "test_lens_that_stops_growing_is_refused_with_the_angle": ("lens polynomial that turns", FISH + "lens.c", "turns inside the field", "refused with the angle"),
        "test_tiny_pictures": ("pictures of 1 pixel", FISH + "weights.c", "1x1 .. 3x3 pixels", "a constant stays constant"),
    },
    "fishremap/test_fishremap_accuracy.py": {
        "test_a_lamp_keeps_its_energy": ("a 2 degree lamp at any output size", FISH + "weights.c", "remap Jacobian over the field", "energy to 0.5 %"),
    },
    "fishremap/test_fishremap_array.py": {
        "test_wrong_corners_are_refused": ("sphere array with one corner wrong", FISH + "spherearray.c", "half a pitch off and more", "refused, one line"),
        "test_corners_by_hand_three_pixels_off": ("sphere array, tilted, corners imprecise", FISH + "spherefind.c", "3 pixels off, turned", "found to a fraction of a pixel"),
        "test_perspective_matters_and_is_corrected": ("sphere array with perspective", FISH + "sphere.c", "camera 3.5 array widths away", "error falls with the correction"),
    },
    "stagectl/test_stagectl.py": {
        "test_nothing_moves_before_homing_and_all_points_are_checked_first": ("stage at its limits", STAGE + "plan.c", "a node beyond the travel", "refused before anything moves"),
        "test_a_position_that_is_not_the_target_is_not_believed": ("stage that stops short", STAGE + "grbl.c", "more than half a step", "refused"),
    },
    "stagectl/test_stagectl_faults.py": {
        "test_slipped_steps_are_noticed_where_they_can_be": ("lost steps", STAGE + "capture.c", "5 mm slipped", "noticed at the next homing"),
        "test_a_day_long_session": ("thousands of moves", STAGE + "capture.c", "30 nodes x 16 exposures (900 with ILF_SWEEP=1)", "each exposure once"),
        "test_killed_at_fifty_random_instants": ("kill -9 in a session", STAGE + "journal.c", "50 random instants", "nothing lost, nothing twice"),
        "test_journal_torn_anywhere_in_its_last_record": ("journal torn by a power cut", STAGE + "journal.c", "every byte of the last record", "resumed"),
        "test_damage_in_the_middle_is_refused": ("journal damaged in the middle", STAGE + "journal.c", "any line but the last", "refused, line named"),
        "test_disk_full_then_resume": ("disk full while capturing", STAGE + "shot.c", "ENOSPC", "stopped, then resumed whole"),
        "test_names_with_blanks_and_quotes_are_safe_in_a_shell": ("hostile names with shell = yes", STAGE + "names.c", "quotes, $(), ;", "one argument each"),
        "test_one_at_a_time": ("two stagectl on one stage", STAGE + "port.c", "port and session", "second refused"),
    },
    "common/test_common_hostile.py": {
        "test_cut_files": ("pictures cut at any byte", COMMON + "image/image.c", "each format", "refused, one line"),
        "test_damaged_files": ("pictures with flipped bytes", COMMON + "image/image.c", "each format", "refused or read, no crash"),
        "test_headers_that_promise_too_much": ("headers that promise more than the file has", COMMON + "image/image.c", "2^31 pixels in 100 bytes", "refused before memory is taken"),
    },
    "common/test_common_image.py": {
        "test_hdr_extremes": (".hdr at the ends of its range", COMMON + "image/image_hdr_write.c", "1e-38 .. 1e38", "within one code, or refused"),
        "test_values_that_are_not_written": ("values that a format can't hold", COMMON + "image/image_write.c", "NaN, inf, above 65504", "refused"),
    },
    "hdrgen/test_hdrgen_hostile.py": {
        "test_any_bytes_as_times_or_response": ("any bytes as times or response", HDR + "respfile.c", "hypothesis", "refused or right"),
        "test_noise_only_series": ("series of noise alone", HDR + "debevec.c", "no signal", "refused, or flagged"),
    },
}

ELSEWHERE = {f"tests/{file}::{test}": what for file, tests in E.items() for test, what in tests.items()}

if __name__ == "__main__":
    print(*ELSEWHERE)
