"""What the worker process (bridge/) calls on the Python side: volume_element.Engine, and a dummy of tests/bridge.

An engine holds its volume elements (VEs) as resident scenes, numbered from 0. All tensors are numpy arrays of
float64, row-major, tension positive. Every array named `out_...` is a view of shared memory to be filled in place.
Errors are exceptions whose text is one clear sentence (what, where, what to do).

    Engine(report_fields)              names of the entries of a report, in order (fe_master/material_points.hpp)
    versions() -> dict                 {"yade": ..., "python": ..., ...}
    make_template(spec) -> dict        spec: the [ve] table of the case as a dict; returns {"state": bytes,
                                       "manifest": dict}. Prepares, loads or runs the user's script; called in a
                                       process of its own.
    add(state) -> int                  new resident VE from a state; its number
    replace(ve, state)                 VE number `ve` becomes that state
    save(ve) -> bytes                  its state; add(save(ve)) continues bit-equal to replace(ve, save(ve))
    remove(ve)
    export_scene(state)                what bridge/compact_scene.hpp takes as bytes, or the sentence why compact cells do not
                                       cover the state
    write_back(ve, exported)           VE number `ve`, made from the same scene, becomes what a compact cell gave back
    referee(ve, exported, velocity_gradient, steps) -> bytes   write_back, then deform with the contacts in the order of their
                                       spheres; the export of the end
    info(ve) -> dict                   {"time_step": s, "time_scale": a sqrt(rho/p) s, "mean_stress": Pa, compression
                                       positive}
    deform(ve, velocity_gradient, steps[, sample_every, late, out_mean])   hold velocity_gradient L (3, 3) [1/s] for
                                       `steps` DEM steps of info's time_step: the cell ends at (I + L time_step)^steps
                                       times where it was; stress and report belong to exactly that end. out_mean: (9,)
                                       mean of the Cauchy stress over the trial [Pa], see mean_stress.py
    measure(ve, out_stress, out_report, out_stretch)   (9,) Cauchy stress [Pa], symmetrised; report: what judges and
                                       counts a trial, NaN where it costs more; (9,) the cell's deformation gradient
                                       from the reference (adopted) state
    complete_report(ve, out_report)    the entries of the report that measure has left NaN, of now; called for committed
                                       states, where a field is written
    follow_network(ve)                 the time step of info() becomes what the state of now asks for; called between
                                       load steps, never within one
    stiffness(ve, out_stiffness, kind)  (81,) Eq. (2) of Nguyen et al. (2017) with both tangents, minor-symmetrised
                                       [Pa] ("affine"), or another of its kind: contact_loop.stiffness_of_kind
"""
