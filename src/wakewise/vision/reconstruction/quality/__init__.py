"""Quality of photographs and models.

- `photo_preview.py`: sharpness, exposure and overlap of photographs before a reconstruction.
- `model_quality.py`: tests of a sparse model. `photo_statistics.py`: figures of each photograph of a finished model.
- `split_half_check.py`: area, volume and rugosity, and their repeatability over two halves of the photographs.
"""
