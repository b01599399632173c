"""The main job in a notebook: run the cells in a clone, beside a `modalbase up`."""

import modalbase

lab = modalbase.connect()
moduli = {"Ex_Pa": 33e9, "Ey_Pa": 32e9, "Gxy_Pa": 5.7e9, "Gxz_Pa": 4.5e9, "Gyz_Pa": 4.5e9}
bar = {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01, "density_kg_m3": 2012, "nu_xy": 0.15}
beam = lab.project("bridge deck", create=True).structure("FRP beam", create=True, **bar, **moduli)
campaign = beam.campaign("March", create=True, boundary="cantilever")
campaign.import_file("examples/tutorial/beam.uff")
result = campaign.update().result()
print(result)
