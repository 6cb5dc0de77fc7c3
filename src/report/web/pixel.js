// pixel
