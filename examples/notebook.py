"""The main job in a notebook: run the cells in a folder with `beam.uff`, beside a `modalbase up`."""

import modalbase

lab = modalbase.connect()
size = {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.010, "density_kg_m3": 2012}
nominal = {"Ex_Pa": 33e9, "Ey_Pa": 32e9, "Gxy_Pa": 5.7e9, "Gxz_Pa": 4.5e9, "Gyz_Pa": 4.5e9, "nu_xy": 0.15}
beam = lab.new_project("bridge deck").new_structure("FRP beam", **size, **nominal)
campaign = beam.new_campaign("March", boundary="cantilever")
campaign.import_file("beam.uff")
result = campaign.update().result()
print(result)
