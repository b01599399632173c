"""A body and its affine system: geometry, material, supports and elements to K(c) and M(m).

constants, kinds           what updating asks of any body; what its modes are called
laminate, sections, beams  plies and their materials to the coefficients of shells; sections of beams
mesh, generators           nodes and blocks of elements; meshes of strips, profiles and panels
elements                   strains of one element, a family a file
strips, operators          elements along a line; blocks of elements to rows over degrees of freedom
affine                     rows and constants to K(c) = Σ c_k K_k and M(m) = Σ m_j M_j
facets, refine             facets as a curved surface; the same body on a finer mesh
junctions, corners         where walls meet, and what each takes of the others there
overlaps, junction_beams   what walls that overlap have twice, and what a corner adds
joints                     the model of a joint, of these
supports, carried, clamps  springs, masses, links; as parts of a model; a clamp that gives way
model                      all of it as one affine model
structure                  a structure as an engineer describes it
named, specimen            bodies whose constants have other names: strips and plates
beam_specimen              a strip as a Timoshenko beam
matrices                   a body that is matrices of any solver
mechanisms                 where its strain energy sits
locate, align              points on its surface, and where a test's frame lies
"""
