"""What the worker process (bridge/) calls on the Python side, and a dummy that answers it without YADE.

An engine holds its volume elements (VEs) as resident scenes, numbered from 0. All tensors are numpy arrays of
float64, row-major, tension positive. Every array named `out_...` is a view of shared memory to be filled in place.
Errors are exceptions whose text is one clear sentence (what, where, what to do).

    Engine(report_fields)              names of the entries of a report, in order (fe_master/material_points.hpp)
    versions() -> dict                 {"yade": ..., "python": ..., ...}
    make_template(spec) -> dict        spec: the [ve] table of the case as a dict; returns {"state": bytes, "manifest": dict}.
                                       Prepares, loads or runs the user's script; called in a process of its own.
    add(state) -> int                  new resident VE from a state; its number
    replace(ve, state)                 VE number `ve` becomes that state
    save(ve) -> bytes                  its state; add(save(ve)) continues bit-equal to replace(ve, save(ve))
    remove(ve)
    info(ve) -> dict                   {"time_step": s, "time_scale": a sqrt(rho/p) s, "volume": m^3, "spheres": n,
                                        "mean_diameter": m, "mean_stress": Pa (compression positive)}
    deform(ve, velocity_gradient, steps)   hold velocity_gradient (3, 3) [1/s] for `steps` DEM steps of info's time_step
    measure(ve, out_stress, out_report, out_stretch)   (9,) Cauchy stress [Pa], symmetrised; report; (9,) the cell's
                                       deformation gradient from the reference (adopted) state
    stiffness(ve, out_stiffness)       (81,) Eq. (2) of Nguyen et al. (2017) with both tangents, minor-symmetrised [Pa]
"""
